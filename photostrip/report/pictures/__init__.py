"""Pictures: plans, strips, terrestrial."""
