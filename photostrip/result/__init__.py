"""What is computed for the document of a result: one plain dictionary, rendered by files and reports.

A ``pipeline.Result`` comes in; ``document.document_of`` makes the content of result.json of it: texts, numbers, None,
lists and dictionaries only. Every key is described in ``quantities.txt`` with unit, decimals and meaning, and records
are rounded by that (``quantities``); ``columns`` lists those of the CSV files. ``adjustment`` has the blocks of
adjustments, ``points`` those of points and photos, ``conventions``, ``summary``, ``tables`` and ``statement`` what
stands around them, ``trace`` the iterations once more; ``verdict`` looks at the finished document by ``own_tests``, and
``methods`` puts those of several adjustments side by side. ``description`` reads quantities.txt, for ``schema`` and
``reading`` too; ``numbers`` rounds, ``records`` are columns that look like lists of records.
"""
