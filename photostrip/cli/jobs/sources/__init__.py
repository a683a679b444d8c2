"""What the sources print: ``worked`` numbers, and ``tables``, of which docs/sources.md is made."""
