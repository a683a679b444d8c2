"""Many projects: each computed in a process of its own, each result written whole or not at all.

::

    arguments -> projects and the names of their results (selection)
       -> unchanged since last time? (result_folder)
       -> tasks -> processes of this machine (pool) or of others (cluster, parcel)
       -> answers: files and a line of the summary (evaluation, outcomes)
       -> written by this process alone (result_folder)
       -> summary (run)

Workers compute and never write: whatever happens to one of them, there is nothing half done on the disk. Whatever
happens to this process, a result counts only when its record, written last, fits every file of it.
"""
