"""Gross errors of rays: measurements that the strip as a whole contradicts.

In comes a formed strip, or a block in a bundle adjustment; out come the rays that must not be used. ``strip_network``
adjusts all rays of a strip as a free network, ``snooping`` tests, takes out and takes back, ``point_decisions`` says
which rays of a point are wrong, ``screened_formation`` forms the strip again without them. Source: [Baarda 1968],
[Pope 1976]; deletion derived, see docs/sources.md.
"""
