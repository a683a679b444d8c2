"""Files as users and other programs write them: the only room that knows csv, gzip and json.

- ``files``, ``faults``, ``tables``: bytes and whole files, what is wrong with them and where, CSV and JSON;
- ``measured``, ``models``, ``terrestrial``: the tables of measured and given coordinates that are read;
- ``result_json``, ``result_files``, ``batch``: what goes out.
"""
