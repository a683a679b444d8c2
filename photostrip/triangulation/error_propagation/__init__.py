"""The law of error propagation through the strip method: covariances of pairs, points, photos and control."""
