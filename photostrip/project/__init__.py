"""Projects, plans, simulations and surveys as users describe them: read, checked and completed, and nothing else.

In comes a YAML file with the tables that it names; out go plain inputs and settings, in millimetres, radians and
metres, east, north, up. All faults of all files are reported at once, each with its place.

- ``sections``: how mappings and values are read; ``reading``: text to a tree of texts with places, presets
  (``extends``), overrides (``--set``), faults; ``keys``: every key of a project with its unit and default;
- ``loading``: a strip project, in order: ``references`` holds what its values owe each other, ``tables`` reads what it
  names, ``conversion`` brings units, axes and rotations into those of the program, ``hints`` says what is not used,
  ``resolved`` writes the project with nothing left open; ``in_memory`` takes projects without files;
- ``check``: what can be said before anything is adjusted;
- ``plans``, ``terrestrial``, ``tolerances``, ``simulation``: the other kinds of files;
- ``template``: the first files of a new project; ``editors``: JSON Schemas of all files.
"""
