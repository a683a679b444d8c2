"""Files as users and other programs write them: the only room that knows csv, gzip and json.

- ``text/``: bytes, text, numbers, CSV tables, each fault with its place; findings; writing whole files or none;
- ``measured/``: the tables of measured and given coordinates that are read;
- ``output/``: the documents of plans and surveys, and the files of results.
"""
