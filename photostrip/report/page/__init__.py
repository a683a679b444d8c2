"""Parts of a page and the ways to show them.

- ``parts``: sections of words, facts and tables; ``tables`` makes a table from rows, ``numbers`` writes numbers,
  ``angles`` angles; ``links`` lead from findings to their rows;
- ``layout``: lines of a given width, for ``text`` (and Markdown) and ``console`` (in colours);
- ``messages``: faults and findings as lines, JSON or annotations; ``junit``: test cases;
- ``progress``: what is being done, on a terminal that waits.
"""
