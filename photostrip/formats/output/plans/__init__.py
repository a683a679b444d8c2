"""Plans as plain documents: a module for each kind; ``table`` is the main table of any of them."""
