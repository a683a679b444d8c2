"""The search for gross errors: in pairs, along the strip, at the control."""
