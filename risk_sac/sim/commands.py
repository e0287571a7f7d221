"""Commands of adversaries for the next step, and how fast they may change before a bound."""

import math
from dataclasses import dataclass
from typing import NamedTuple

from risk_sac.jit import compiled
from risk_sac.types import STEP_S


@dataclass(slots=True)
class Walker:
    """A pedestrian's state; the command of a step is its next state."""

    x_m: float
    y_m: float
    heading_rad: float
    speed_mps: float
    accel_mps2: float = 0.0


class VehicleCommand(NamedTuple):
    """Speeds of an adversary vehicle during the next step."""

    speed_mps: float
    lateral_mps: float


@compiled
def taper(distance: float, rate: float) -> float:
    """Computes the largest value that can fall to 0 within a distance.

    It falls by at most `rate` per second, and its sum over steps stays within `distance`.

    With decrements of c = rate·dt and D = distance/dt, k full decrements fit, k(k+1)/2·c <= D, and the rest is
    spread over k + 1 steps. The continuous √(2·rate·distance) would overshoot by up to half a decrement.
    """
    if distance <= 0.0 or rate <= 0.0:
        return 0.0
    change, total = rate * STEP_S, distance / STEP_S
    full = int((math.sqrt(1.0 + 8.0 * total / change) - 1.0) / 2.0)
    return full * change / 2.0 + total / (full + 1)


@compiled
def clip(value: float, low: float, high: float) -> float:
    """The value, or the bound that it is beyond."""
    return low if value < low else high if value > high else value
