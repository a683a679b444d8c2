"""YAML files: from text to a model with types, and to faults with file, line, column and key."""
