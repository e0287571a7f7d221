"""What adversaries are told to do in the next step."""

from dataclasses import dataclass
from typing import NamedTuple


@dataclass(slots=True)
class Walker:
    """A pedestrian's state; the command of a step is its next state."""

    x_m: float
    y_m: float
    heading_rad: float
    speed_mps: float
    accel_mps2: float = 0.0


class VehicleCommand(NamedTuple):
    """What an adversary vehicle does during the next step."""

    speed_mps: float
    lateral_mps: float
