"""Independent models: measured model coordinates joined to a strip by a similarity in space from model to model."""
