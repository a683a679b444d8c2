"""What a bundle adjustment is given, what it estimates, and the derivatives between them."""
