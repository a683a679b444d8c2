"""Gross errors that the strip method finds: of pairs by y parallaxes, of the control by the strip.

Everywhere the fewest observations are sought without which an adjustment passes its test. In come oriented pairs, a
formed strip, its control; out come the same without what contradicts the rest, and what was rejected with test value,
limit and estimated error. Source: [004a] for single pairs; derived, docs/sources.md.
"""
