"""Courses of a value to its target: step, linear, cubic and sinusoidal."""

import math
from dataclasses import dataclass

from risk_sac.config.story_actions import Dynamics, Shape

SAME = 1e-9
# Largest slope of a shape from 0 to 1 over [0, 1].
STEEPEST = {"linear": 1.0, "cubic": 1.5, "sinusoidal": math.pi / 2}


def share(shape: Shape, progress: float) -> float:
    """Share of a change made at a progress in [0, 1].

    linear: u;  cubic: 3 u² - 2 u³;  sinusoidal: (1 - cos π u) / 2;  step: 1
    """
    u = min(max(progress, 0.0), 1.0)
    if shape == "linear":
        return u
    if shape == "cubic":
        return u * u * (3.0 - 2.0 * u)
    return (1.0 - math.cos(math.pi * u)) / 2.0 if shape == "sinusoidal" else 1.0


def length_of(dynamics: Dynamics, change: float) -> float:
    """Time or way that a change takes, s or m.

    Choice: the rate of a shape is its largest one, as in UN R157's "maximum lateral velocity" of a cut-in. A rate of 0
    leads nowhere.
    """
    value = float(dynamics.value)
    if dynamics.shape == "step" or abs(change) < SAME:
        return 0.0
    if dynamics.by != "rate":
        return max(value, 0.0)
    return STEEPEST[dynamics.shape] * abs(change) / abs(value) if value else math.inf


def lateral_time_s(shape: Shape, change_m: float, most_mps2: float | None) -> float:
    """Time for a lateral move at its acceleration bound, s; 0 unbounded.

    sinusoidal: a = π² d / 2 T²;  cubic: a = 6 d / T²
    Choice: linear takes as long as to accelerate and brake with the bound, a = 4 d / T².
    """
    if shape == "step" or most_mps2 is None or abs(change_m) < SAME:
        return 0.0
    if most_mps2 <= 0.0:
        return math.inf
    factor = {"linear": 4.0, "cubic": 6.0, "sinusoidal": math.pi**2 / 2}[shape]
    return math.sqrt(factor * abs(change_m) / most_mps2)


@dataclass(frozen=True, slots=True)
class Course:
    """Course of a value over time or way."""

    shape: Shape
    start: float
    length: float  # s or m; 0: at once

    def value(self, gone: float, target: float) -> float:
        """The value after a time or way, towards a target."""
        if self.is_over(gone):
            return target
        progress = 0.0 if math.isinf(self.length) else gone / self.length
        return self.start + (target - self.start) * share(self.shape, progress)

    def is_over(self, gone: float) -> bool:
        """Whether the target is reached."""
        return gone >= self.length - SAME
