"""A strip of independent models, from the measured models to adjusted points."""
