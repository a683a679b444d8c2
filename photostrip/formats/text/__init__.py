"""Files, tables and numbers as text, with findings that name the line."""
