"""Ground frames: map, geographic, geocentric and local coordinates, tied to one Cartesian frame.

Comes in: what a project says of its frames (``frame_spec``). Goes out: a ``GroundFrame`` for each (``tying``,
``ground_frame``), with coordinates and directions of axes, and the ``IntermediateFrame`` in which a strip is adjusted
(``local_frame``). ``crs``, which also joins two zones of plane coordinates, and ``proj_operation``, which changes
datums, are the only users of pyproj.

Source: [001] eq. 142-144, 152, 153; [Bowring 1976].
"""
