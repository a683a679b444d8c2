"""What a script or a notebook calls: load, check, run, simulate, plan and compare, and what these return.

``import photostrip`` is enough: the package hands these names on and loads them when they are first asked for. The
commands call the same functions; what they refuse is raised here, with the same faults and findings.
"""
