"""Files that are written: results, plans, simulations, batches.

Plain documents come in, texts go out: ``result_json`` and ``result_files`` for result.json and its tables,
``result_lines`` for where its records stand, ``simulation`` for a project with its truth, ``batch`` for summaries and
records. Nothing of a result is computed here; columns and decimals come from its description.
"""
