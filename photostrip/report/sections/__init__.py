"""Sections of the accuracy report of a run.

In comes the document of a result (result.json); ``accuracy_report`` puts the sections in their order, the worst first:
verdict and findings, project and decisions, how the strips were formed and brought to the ground, what is left at the
points. With ``everything`` all rows of all tables are shown, not only the worst of long ones. Symbols are those of
docs/notation.md.
"""
