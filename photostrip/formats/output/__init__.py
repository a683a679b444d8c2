"""Files that are written: results, plans, simulations, batches.

In come documents of results and outcomes of batches, plans and reports of ``planning``, surveys, simulations; out go
texts by file name, and documents that reports print: angles in the user's unit, ground in metres, errors in µm and ″.

- ``result_json`` with ``json_lines`` and ``json_encoder``: result.json; ``result_files``: its tables in CSV;
  ``csv_text``: those of other documents; ``result_lines``: where the records of a result stand;
- ``plans``, ``terrestrial_directions``, ``terrestrial_displacements``: documents, and tables of them;
- ``simulation``, ``simulation_tables``, ``simulation_truth``: a project with its truth; ``batch``: summaries, records.
"""
