"""Gross errors in the pairs: residual parallaxes, Grubbs, tau, minimum deletion."""
