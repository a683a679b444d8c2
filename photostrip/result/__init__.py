"""What is computed for the document of a result: one plain dictionary, rendered by files and reports."""
