"""Interior orientation: from measured fiducial marks to photo coordinates."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Settings:
    """How photo coordinates are formed from measured fiducial marks.

    Parameters
    ----------
    transform : str
        ``"conformal"`` (two marks or more), ``"affine"`` (three or more), ``"bilinear"`` or ``"projective"``
        (four or more); ``"auto"``: affine from four marks on, conformal with two or three.
    """

    transform: str = "auto"
