"""Errors of one oriented model.

``single_model`` with ``given_errors``: the theory [000]; ``closed_form`` the same as sums; ``deformation`` simple
formulas and the paraboloid [003]; ``plan`` puts them together.
"""
