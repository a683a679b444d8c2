"""The keys of the YAML files: what each may be, its unit, its default."""
