"""What is computed for the document of a result: one plain dictionary, rendered by files and reports.

A ``pipeline.Result`` comes in; ``document.document_of`` makes the content of result.json of it: blocks of keys, and
tables (``table``), numpy columns of equal length. Every key and column is described in ``quantities.txt`` with unit,
decimals and meaning (``description``); ``quantities`` rounds by it, ``reading`` checks by it what is read again,
``schema`` writes it out. ``adjustment`` has the blocks of adjustments, ``points`` those of points and photos,
``conventions``, ``summary`` and ``statement`` what stands around them, ``trace`` the iterations once more; ``verdict``
looks at the finished document by ``own_tests``, and ``methods`` puts those of several adjustments side by side.
"""
