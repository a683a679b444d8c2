"""Gross errors of pairs: points whose y parallax the other points of the pair contradict.

``screening`` holds the methods by name and the tests of single residuals, ``pair_search`` the robust start and the
search by ``global_test`` and ``deletion`` of the fewest points, with the ``parallax_scatter`` in force; ``zones`` keeps
pairs supported. Source: [004a]; derived.
"""
