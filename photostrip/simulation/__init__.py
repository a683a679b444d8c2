"""Strips of photos with known truth: what would be measured, and what it should give.

In comes a ``Spec``, out go observations, control and truth, without rounding. ``draws`` gives random numbers that are
the same on every machine; ``flight`` the world and what photos show of it, ``placement`` the points and the control,
``measuring`` film, models of a plotter and gross errors.

>>> from photostrip.simulation import Flight, Spec, simulate
>>> simulation = simulate(Spec(flight=Flight(photos=5)))
>>> simulation.strips[0]
('A', ('1001', '1002', '1003', '1004', '1005'))
"""

from photostrip.simulation.measuring import InjectedError
from photostrip.simulation.simulation import Simulation, Truth, simulate
from photostrip.simulation.spec import (
    DIGITAL,
    FILM,
    PRESETS,
    Control,
    Film,
    Flight,
    Gnss,
    GrossError,
    Ground,
    Image,
    Models,
    Points,
    Spec,
    Terrain,
)

__all__ = [
    "DIGITAL",
    "FILM",
    "PRESETS",
    "Control",
    "Film",
    "Flight",
    "Gnss",
    "GrossError",
    "Ground",
    "Image",
    "InjectedError",
    "Models",
    "Points",
    "Simulation",
    "Spec",
    "Terrain",
    "Truth",
    "simulate",
]
