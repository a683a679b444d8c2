"""The keys of the YAML files: what each may be, its unit, its default.

- ``values``: single values, from text to type, and what is wrong with them;
- ``cameras``, ``measurements``, ``ground``, ``processing``: the blocks of the project file;
- ``exports``: what a result is written as for other programs;
- ``project_file``: the whole of it; ``sections``: how mappings are read, with all that is wrong in them.
"""
