"""The files and options of ``photostrip terrestrial``: out go surveys and points in millimetres and radians.

- ``survey_file``: the keys of a survey; ``survey``: a survey read with its table, ``series`` being the table;
- ``cameras``: phototheodolites by name; ``options``: what the command line gives; ``ranges``: what numbers can be.
"""
