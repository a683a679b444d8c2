"""The document of a trace: every iteration of a finished run, with the symbols of the formulas.

``replay`` repeats relative and absolute orientation of a ``Result`` from the same start, step by step; ``trace`` writes
these, the chain, scale transfer and polynomials with the letters of the sources (eq. 138 to 151), for pencil and paper;
``departures`` says where a run departs from the textbook.
"""
