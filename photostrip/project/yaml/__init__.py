"""YAML files with positions: from text to a model with types, and to faults with file, line, column and key.

- ``tree``: the tree of texts that know where they stand; faults at their places;
- ``parsing``: text to tree, over the events of PyYAML; what cannot be trusted is refused;
- ``merging``: what ``extends`` brings and ``--set`` overrides;
- ``validation``: the tree against a schema, in the words of the user;
- ``reading``: all of it, for every kind of file;
- ``references``: what the values of a project file owe each other.
"""
