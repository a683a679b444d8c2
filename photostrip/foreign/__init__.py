"""Other programs' files: what they hold as a project, which is written, edited and run; and results as such files.

Comes in: a path, or the content of result.json. ``sources`` knows what a path is; ``colmap`` and ``opensfm`` read
models, which ``gathering`` puts together, ``historix`` camera and positions of archive photos, ``metashape`` cameras;
``nodes``, ``elements`` and ``places`` say where something stands in them. ``control``, ``opensfm_control`` and
``metashape_markers`` put points with their marks beside them, ``events`` positions of the photos. What is handed on is
a ``tables.ForeignBlock``; ``project`` writes it as a project and says what was understood. A run knows nothing of other
programs' files. ``adjusted`` takes out of a result what other programs need, ``exports`` makes their files:
``geopackage`` layers on a map, ``orthority`` orientations for orthophotos, ``historix_submission`` orientations and
points for HISTORIX, ``colmap_model`` a model of COLMAP, ``opensfm_model`` one of OpenSfM, ``cameras`` a block of a
project. ``simulated`` writes a simulation as a project with its truth.
"""
