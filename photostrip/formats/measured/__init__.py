"""Tables of measured and given coordinates."""
