"""What the sources print: ``worked`` numbers, and ``tables`` of misprints and equations."""
