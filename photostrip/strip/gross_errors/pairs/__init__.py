"""Gross errors of pairs: points whose y parallax the other points of the pair contradict.

``screening`` holds the methods by name and the tests of single residuals, ``pair_search`` the robust start and the
search by ``global_test``, with the scatter in force, and ``deletion`` of the fewest points. Source: [004a]; derived.
"""
