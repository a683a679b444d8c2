"""Files that are written: results, simulations, batches.

In come documents of results and outcomes of batches, simulations; out go texts by file name.

- ``result_json``: result.json; ``result_files``: its tables in CSV;
  ``csv_text``: those of other documents; ``result_lines``: where the records of a result stand;
- ``simulation``, ``simulation_tables``, ``simulation_truth``: a project with its truth; ``batch``: summaries, records.
"""
