"""How good it would be: expected errors of one model, of a strip and its control, and of cameras, before any flight."""
