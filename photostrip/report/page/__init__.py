"""Parts of a page and the ways to show them.

- ``parts``: sections of words, facts and tables; ``tables`` makes tables of rows by the descriptions of their columns;
- ``layout``: lines of a given width, Markdown, and the terminal with its colours;
- ``messages``: faults and findings as lines, JSON, annotations or test cases;
- ``progress``: what is being done, on a terminal that waits.
"""
