"""Files that are written: results, plans, simulations."""
