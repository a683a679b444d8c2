"""Reports, rendered from the document of a result, a plan, a comparison and from nothing else.

In comes a document of plain values, as JSON has them; out go sections of sentences, facts and tables (``page.parts``),
and from these text, Markdown, HTML or a coloured terminal. Nothing is computed; numbers are only rounded.

- ``sections``: the accuracy report of a run, its statement and certificate; ``commands``: the reports of others;
- ``page``: parts of a page, tables, numbers as they are printed, and the ways to show them;
- ``html`` with ``templates`` and ``pictures``: the report as one page with pictures.
"""
