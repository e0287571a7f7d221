"""Interface of an ego that drives itself: its perceptions and commands.

An ego gets what the line-of-sight sensor and its memory have, and a bicycle with limits (`risk_sac.egos.pilot`) does
as much of a command as a car can. Units are metric: x east, y north, heading 0 = east, counter-clockwise, radians; a
position is the centre of a body.
"""

from dataclasses import dataclass, field
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from risk_sac.world.types import Floats, Road, Signal


@dataclass(frozen=True, slots=True, kw_only=True)
class Vehicle:
    """The car that an ego drives, and its limits in this episode."""

    length_m: float
    width_m: float
    wheelbase_m: float = 2.7  # the body's centre is in the middle between the axles
    accel_mps2: float = 2.6  # the most it speeds up
    brake_mps2: float = 9.0  # the hardest it brakes on this road
    brake_jerk_mps3: float = 12.65  # at which a braking builds up
    steering_rad: float = 0.55  # of the front wheels, to either side
    steering_rate_rad_s: float = 0.6
    grip_mps2: float = 9.81  # friction · g: what the tyres bear along and across together


@dataclass(frozen=True, slots=True, kw_only=True)
class EpisodeStart:
    """Data that an ego gets before it drives."""

    seed: int  # of all chance in the ego: the same seed and the same perceived frames have to give the same commands
    net: str  # the road network's file
    route: tuple[str, ...]  # edges of the net
    vehicle: Vehicle
    step_s: float  # between two perceived frames
    road: Road = field(default_factory=Road)  # lanes and stop lines around the route


class Perceived(NamedTuple):
    """Perception of an ego at one moment.

    Every array has `n` columns, of which the first is the ego itself.

    Rows of `state` are those of `risk_sac.world.types`; LATERAL, ACCEL and OFFSET of others are NaN: no sensor measures
    them. An actor that is out of sight, but remembered, is where the ego expects it.
    """

    time_s: float  # since the simulation began
    ids: tuple[str, ...]  # as long as an actor is known, it keeps its id
    kind: NDArray[np.int8]  # of `risk_sac.world.types.Kind`
    state: Floats  # rows x n
    path: Floats  # rows of `risk_sac.egos.driving` x p: the middle of its first lane, on along its route
    station_m: float  # of its front bumper on the path
    offset_m: float  # of its front bumper's middle from the path, positive to the left
    signal: Signal  # ahead of it
    stop_line_m: float  # from its front bumper to that signal's stop line; inf without one
    signals: tuple[Signal, ...] = ()  # at each stop line of the episode's road


class Control(NamedTuple):
    """Command: acceleration, negative to brake, and angle of the front wheels."""

    accel_mps2: float
    steering_rad: float = 0.0  # positive to the left


class Trajectory(NamedTuple):
    """Command: places and speeds at `k` ≥ 2 rising times from now."""

    time_s: Floats
    x_m: Floats
    y_m: Floats
    speed_mps: Floats


Command = Control | Trajectory


class Ego(Protocol):
    """Driver in lock-step: a command per perceived frame, held for one step.

    The class declares as literals, which are read without running it: `version`, `response_time_s` (within which it
    responds to a danger, from which its requirements follow); if it is not 60, `deadline_s` for each answer; and, if a
    run may not have any number of them, `instances`. The first line of its docstring is its summary.
    """

    def reset(self, episode: EpisodeStart) -> None:
        """Begins an episode."""

    def act(self, perceived: Perceived) -> Command:
        """Returns the command for the next step."""

    def close(self) -> None:
        """Releases what it holds."""
