"""Ground frames: map, geographic, geocentric and local coordinates, tied to one Cartesian frame.

- ``crs``: coordinate reference systems as the user names them (the only user of pyproj);
- ``local_frame``: the ellipsoid, and the intermediate frame the strip is adjusted in;
- ``curvature``: radii of the ellipsoid and the curvature correction of heights.
"""
