"""Projects, plans, simulations and surveys as users describe them: read, checked and completed, and nothing else.

In comes a YAML file with the tables that it names; out go plain inputs and settings, in millimetres, radians and
metres, east, north, up. All faults of all files are reported at once, each with its place.

- ``yaml/``: positions, presets (``extends``), overrides (``--set``), validation; ``reading`` is the one reader;
- ``schema/``: every key with its unit and default;
- ``loading``: a strip project, in order: ``tables`` and ``models`` read what it names in the ``forms`` that it says,
  ``conversion`` brings units and axes into those of the program, ``attitudes`` rotations, ``hints`` says what is not
  used, ``resolved`` writes the project with nothing left open, ``places`` finds where a finding would be put right;
  ``pixel_size`` follows from the marks, ``in_memory`` takes projects without files;
- ``checks/``: what can be said before anything is adjusted;
- ``plans/``, ``terrestrial/``, ``profiles/``, ``simulation``: the other kinds of files;
- ``template``: the first files of a new project; ``editors``: JSON Schemas of all files.
"""
