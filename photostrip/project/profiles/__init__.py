"""Profiles: what two results may differ by (``tolerances``), classes of a national norm (``classes``)."""
