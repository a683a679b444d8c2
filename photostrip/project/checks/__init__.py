"""What ``photostrip check`` says of a project before anything is adjusted.

In comes a project that was read; out goes ``Checked``: faults, findings, notes, and a document of counts, ground
frames, standard deviations of the control and what became of every row of every table. Whether pairs, junctions and
control suffice follows from the least numbers that the operations need.

- ``check``: projects of photos; ``models``: of independent models; ``table_rows``: the rows of the tables.
"""
