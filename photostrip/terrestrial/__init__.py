"""Terrestrial photogrammetry: directions of a phototheodolite, displacements by pseudo-parallaxes.

- ``frame``: how a camera looks at the ground, and the direction of a ray;
- ``directions``: photo coordinates to directions and back;
- ``accuracy``: how accurate correction directions must be, and what a theodolite is good for;
- ``orientation``: a photo oriented by directions to distinct points;
- ``normal_case``: two photos of any orientation brought to the normal case;
- ``displacement``: displacements of points between two epochs;
- ``camera_motion``: cameras that turned between epochs;
- ``monitoring``: all epochs of all points, as a time series.
"""
