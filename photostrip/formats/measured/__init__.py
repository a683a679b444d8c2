"""Tables of measured and given coordinates, in the units and axes of the file.

- ``observations``, ``measurements``: points and fiducial marks on photos, of ``pairs`` too, ``repeated`` or not;
- ``models``: independent models; ``control``, ``exterior``: given points, camera positions and orientations;
- ``terrestrial``: directions, epochs and pseudo-parallaxes; ``columns``: what several tables share;
- ``steps``: tables of single steps of the method.
"""
