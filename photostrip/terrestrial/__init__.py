"""Terrestrial photogrammetry: directions of a phototheodolite, displacements by pseudo-parallaxes.

- :mod:`photostrip.terrestrial.frame`: how a camera looks at the ground, and the direction of a ray;
- :mod:`photostrip.terrestrial.directions`: photo coordinates to directions and back;
- :mod:`photostrip.terrestrial.accuracy`: how accurate correction directions must be, and what a theodolite is good for;
- :mod:`photostrip.terrestrial.orientation`: a photo oriented by directions to distinct points;
- :mod:`photostrip.terrestrial.normal_case`: two photos of any orientation brought to the normal case;
- :mod:`photostrip.terrestrial.displacement`: displacements of points between two epochs;
- :mod:`photostrip.terrestrial.camera_motion`: cameras that turned between epochs;
- :mod:`photostrip.terrestrial.monitoring`: all epochs of all points, as a time series.
"""
