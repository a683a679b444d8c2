"""How good a bundle is: precision, correlations, reliability, variance components, self-calibration."""
