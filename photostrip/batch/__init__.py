"""Many projects: each computed in a process of its own pool, each result written whole or not at all.

One walk again::

    arguments -> projects and the names of their results (selection)
       -> unchanged since last time? (records, folder)
       -> tasks -> workers: processes here (pool, worker) or on other machines (cluster, remote)
       -> answers: files and one line of the summary (work, tasks) -> written by this process alone (folder)
       -> summary (run)

Workers compute and never write: whatever happens to one of them, there is nothing half done on the disk. Whatever
happens to this process, a result counts only when its record, written last, fits every file of it.
"""
