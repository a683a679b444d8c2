"""The result as files: ``result.json`` with everything, and tables for those who want a spreadsheet.

- :mod:`photostrip.formats.result.document`: from the result of the pipeline to one plain dictionary;
- :mod:`photostrip.formats.result.files`: that dictionary as JSON and CSV, and back, without any mathematics.
"""
