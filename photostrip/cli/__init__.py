"""What a user types: one file per command, and ``main`` that finds them."""
