"""What is computed for the document of a result: one plain dictionary, rendered by files and reports.

A ``pipeline.Result`` comes in; ``document.document_of`` makes the content of result.json of it: blocks of keys, and
tables (``table``), numpy columns of equal length. Every key and column is described in ``quantities.txt`` with unit,
decimals and meaning (``description``); ``numbers`` rounds by it, ``reading`` checks by it what is read again. The other
modules have the blocks of their subject; ``derived`` adds what columns tell of each other, ``verdict`` looks at the
finished document.
"""
