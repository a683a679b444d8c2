"""A strip adjusted to its control by its own covariance."""
