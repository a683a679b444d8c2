"""The project file as YAML with positions: document, merging, validation, schema, references."""
