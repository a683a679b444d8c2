"""Ground frames: map, geographic, geocentric and local coordinates, tied to one Cartesian frame.

- :mod:`photostrip.geodesy.crs`: coordinate reference systems as the user names them (the only user of pyproj);
- :mod:`photostrip.geodesy.local_frame`: the ellipsoid, and the intermediate frame the strip is adjusted in;
- :mod:`photostrip.geodesy.curvature`: radii of the ellipsoid and the curvature correction of heights.
"""
