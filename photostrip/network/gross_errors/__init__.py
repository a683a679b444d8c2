"""Gross errors of rays: measurements that a strip or block as a whole contradicts.

``strip_network`` makes a bundle of all rays of a formed strip, ``snooping`` adjusts and tests a bundle,
``ray_decisions`` linearises points for ``point_decisions``, which finds the fewest rays of a point without which the
others agree; ``ray_log`` keeps what was said of them; ``strip_rays`` is what comes in.

Source: [Baarda 1968], [Pope 1976]; the decisions are derived, see docs/sources.md.
"""
