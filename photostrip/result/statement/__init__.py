"""The accuracy statement of a norm: what the check points carry, and what forbids to state it.

- ``figures``: what norms ask of differences at check points, with their factors;
- ``evidence``: the block ``statement`` of a result;
- ``stating``: classes that are asked for, sentences; ``classes``: those of a profile;
- ``accuracy_statement``: the document of ``photostrip statement``;
- ``certificate``: hashes of all that went in; ``edited``: results whose numbers are not those of it.
"""
