"""Other programs' files: what they hold as the tables of a project, which is written and then edited and run.

Comes in: a path. ``colmap`` reads models of COLMAP. ``control`` puts points with their
marks beside it. What is handed on is a ``tables.ForeignBlock``; ``project`` writes it as a project and says what was
understood. A run knows nothing of other programs' files.
"""
