"""Image coordinates: from what is measured on a photo to ideal coordinates about the principal point.

Comes in: measured points and fiducial marks, cameras. ``interior`` brings points into the system of the marks (checked
in ``fiducial_marks``), ``corrections`` removes lens distortion (``lens_distortion``), refraction and, where asked for,
Earth curvature. Goes out: ``PhotoPoints`` for the pairs.
``pixel_cameras`` makes millimetres of cameras that other programs give in pixels.

Source: [Brown 1966], [Fraser 1997], [Kraus], [Saastamoinen 1972]; transformations are derived.
"""
