"""Strip formation: from oriented pairs to one strip in the frame of its first photo.

Comes in: the ``Orientation`` of all pairs. Goes out: a ``FormedStrip`` with perspective centres, rotations, the scale
of each model, the coordinates of all points and the ``Junctions`` at which models were joined. ``intersection`` makes
model points, ``scale_transfer`` brings neighbouring models to one scale on their pass points, ``strip`` hands the
orientation on.

Source: [001] eq. 125-141.
"""
