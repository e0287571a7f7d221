"""Turns the joint action in [-1, 1] into commands of all adversaries.

It also checks whether the commands were kept.

Vehicles take (longitudinal acceleration, lateral velocity), pedestrians (acceleration, heading rate).
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from risk_sac.scenario.bodies import body_of
from risk_sac.scenario.families import Family
from risk_sac.scenario.layout import StoryPlan
from risk_sac.scenario.limits import Limits
from risk_sac.sim.solid import ALONE, Others, VehicleCommand, Walker, clip, taper, walks_into
from risk_sac.sim.story.cast import DeviationControl, Lead
from risk_sac.sim.sumo import SumoSimulation
from risk_sac.sim.vehicle_control import VehicleControl, drove_as_commanded
from risk_sac.world.types import STEP_S, Frame, Role


@dataclass(slots=True)
class PedestrianControl:
    """Integrator of a pedestrian's motion, with acceleration bounded by a disc.

    Source: that heading rate falls with about 1/speed, Wang et al., A kinematic constraint on pedestrian walking
    (arXiv 2506.15321).
    """

    limits: Limits
    state: Walker
    across_mps2: float = 0.0

    @property
    def _stopping(self) -> tuple[float, float, float]:
        limits = self.limits
        return limits.walk_brake_mps2, limits.walk_jerk_mps3, limits.walk_disc_mps2 / limits.heading_rate_radps

    def step(self, drive: float, turn: float, others: Others = ALONE) -> Walker:
        """Moves the pedestrian by one step.

        Acceleration and heading rate (clockwise below 0) are shares of what is allowed, -1 to 1. It keeps clear of
        `others`.
        """
        for wanted in ((drive, turn), (-1.0, 0.0)):
            walker, across_mps2 = self._walk(*wanted)
            walk = (walker.x_m, walker.y_m, walker.heading_rad, walker.speed_mps, walker.accel_mps2, across_mps2)
            if not walks_into(*others, walk, self._stopping):
                break
        self.state, self.across_mps2 = walker, across_mps2
        return walker

    def _walk(self, drive: float, turn: float) -> tuple[Walker, float]:
        """The next state, and the acceleration across."""
        limits, state = self.limits, self.state
        accel, across_mps2 = self._accelerate(drive, turn)
        speed = clip(state.speed_mps + accel * STEP_S, 0.0, limits.walk_speed_mps)
        disc = limits.walk_disc_mps2
        rate = across_mps2 / max(state.speed_mps, speed, disc / limits.heading_rate_radps)
        if math.isfinite(limits.walk_curvature_per_m):
            sharpest = limits.walk_curvature_per_m * max(state.speed_mps, speed)
            rate = clip(rate, -sharpest, sharpest)
        turned = rate * STEP_S
        distance, middle = (state.speed_mps + speed) / 2 * STEP_S, state.heading_rad + turned / 2
        walker = Walker(
            x_m=state.x_m + distance * math.cos(middle),
            y_m=state.y_m + distance * math.sin(middle),
            heading_rad=state.heading_rad + turned,
            speed_mps=speed,
            accel_mps2=(speed - state.speed_mps) / STEP_S,
        )
        return walker, across_mps2

    def _accelerate(self, drive: float, turn: float) -> tuple[float, float]:
        """Computes acceleration along and across, towards the action on the disc.

        It changes by at most the jerk.
        """
        limits, along, across = self.limits, self.state.accel_mps2, self.across_mps2
        jerk = limits.walk_jerk_mps3
        low = -taper(self.state.speed_mps, jerk)
        high = taper(limits.walk_speed_mps - self.state.speed_mps, jerk)
        wanted = drive * (limits.walk_accel_mps2 if drive >= 0 else limits.walk_brake_mps2)
        to_along, to_across = clip(wanted, low, high), turn * limits.walk_disc_mps2
        too_much = max(math.hypot(to_along, to_across) / limits.walk_disc_mps2, 1.0)
        to_along, to_across = to_along / too_much - along, to_across / too_much - across
        share = min(jerk * STEP_S / max(math.hypot(to_along, to_across), 1e-9), 1.0)
        # The disc is convex, and the taper only takes acceleration away: nothing leads out of it.
        return clip(along + share * to_along, low, high), across + share * to_across


def shares_of(action: object, size: int) -> list[float]:
    """The entries of a joint action, clipped to [-1, 1].

    Raises:
      ValueError: it has another shape, or an entry that is no finite number.
    """
    wanted = f"shape ({size},), finite numbers in [-1, 1]"
    try:
        values = np.asarray(action)
    except (ValueError, TypeError, RuntimeError) as error:  # ragged, or a tensor that needs its gradient
        raise ValueError(f"action: got {type(action).__name__}, {error}; wanted {wanted}") from error
    if values.shape != (size,) or values.dtype.kind not in "fiu":
        raise ValueError(f"action: got shape {values.shape}, dtype {values.dtype}; wanted {wanted}")
    shares: list[float] = values.tolist()
    if not all(map(math.isfinite, shares)):
        raise ValueError(f"action: got {shares}; wanted {wanted}")
    return [share if -1.0 <= share <= 1.0 else math.copysign(1.0, share) for share in shares]


class Adversaries:
    """Adversaries of an episode."""

    slots: NDArray[np.intp]

    def __init__(self, family: Family, limits: Limits, frame: Frame, story: StoryPlan | None = None) -> None:
        """Starts from the motion in `frame`; story actors deviate from their story."""
        f, rows = frame, {id_: row for row, id_ in enumerate(frame.ids)}
        there = [id_ for id_ in family.adversaries if id_ in rows]  # a document may leave one out of a scene
        own = {id_: limits.of(body_of(int(frame.body[rows[id_]]))) for id_ in there}
        self._deviating = {
            id_: DeviationControl(story.deviation, own[id_], free=story.actors[id_].free)
            for id_ in there
            if story is not None and id_ in story.actors
        }
        there = [id_ for id_ in there if id_ not in self._deviating]
        self._vehicles = {
            id_: VehicleControl(own[id_], *(float(a[rows[id_]]) for a in (f.speed_mps, f.accel_mps2, f.lateral_mps)))
            for id_ in family.vehicles
            if id_ in there
        }
        self._motions = np.array([control.motion for control in self._vehicles.values()]).reshape(-1, 3)
        for control, motion in zip(self._vehicles.values(), self._motions, strict=True):
            control.motion = motion
        self._pedestrians = {}
        for id_ in (id_ for id_ in family.pedestrians if id_ in there):
            walker = Walker(*(float(a[rows[id_]]) for a in (f.x_m, f.y_m, f.heading_rad, f.speed_mps)))
            self._pedestrians[id_] = PedestrianControl(own[id_], walker)
        self._order = family.adversaries
        self._slot = {id_: k for k, id_ in enumerate(self._order)}
        self._ids: tuple[str, ...] = ()
        self._statics = int(np.count_nonzero(frame.role == int(Role.STATIC)))  # they never leave

    def command(self, action: Sequence[float], frame: Frame, sim: SumoSimulation) -> None:
        """Sends a joint action, two entries per adversary; `frame` is the latest."""
        first, second = action[::2], action[1::2]
        self.rows(frame)
        rows = self._row_of
        intended = sim.intended_accel()
        vehicles = {}
        slot = self._slot
        for id_, control in self._vehicles.items():
            place, k = sim.place(id_), slot[id_]
            if place is not None:
                others = frame.state, rows[id_]
                vehicles[id_] = control.step(first[k], second[k], *place, intended[id_], others, self._statics)
        walkers = {
            id_: control.step(first[slot[id_]], second[slot[id_]], (frame.state, rows[id_]))
            for id_, control in self._pedestrians.items()
        }
        sim.apply(vehicles, walkers, self._leads(action))

    def _leads(self, action: Sequence[float]) -> Mapping[str, Lead]:
        """Returns what leads actors of the story away from it."""
        slot = self._slot
        return {
            id_: partial(control.step, action[2 * slot[id_]], action[2 * slot[id_] + 1])
            for id_, control in self._deviating.items()
        }

    def rows(self, frame: Frame) -> NDArray[np.intp]:
        """Returns the frame's adversary rows; `slots` are their places in family order."""
        if frame.ids is not self._ids:
            self._ids = frame.ids
            self._row_of = {id_: row for row, id_ in enumerate(frame.ids)}
            present = [id_ for id_ in self._order if id_ in self._row_of]
            self._rows = np.array([self._row_of[id_] for id_ in present], dtype=np.intp)
            self._driven = np.array([self._row_of.get(id_, 0) for id_ in self._vehicles], dtype=np.intp)
            self.slots = np.array([self._slot[id_] for id_ in present], dtype=np.intp)
        return self._rows

    def keep_limits(self, frame: Frame) -> bool:
        """Whether every adversary vehicle drove as commanded, and so inside its limits.

        Less lateral motion than commanded passes: SUMO pauses it for some steps where a vehicle enters a junction.
        Pedestrians move by our own dynamics and cannot deviate. The controls continue from what was driven.
        """
        self.rows(frame)
        return drove_as_commanded(frame.state, self._driven, self._motions)


WALK = ("x_m", "y_m", "heading_rad", "speed_mps", "accel_mps2")
DRIVE = ("speed_mps", "lateral_mps")


class RecordedAdversaries(Adversaries):
    """Adversaries that move as recorded, and as commanded once the recording ends.

    They keep clear of nothing meanwhile, and their limits are not checked again.
    """

    def __init__(
        self,
        family: Family,
        limits: Limits,
        frame: Frame,
        story: StoryPlan | None,
        series: Mapping[str, NDArray[Any]],
    ) -> None:
        """Starts from the motion in `frame`, the recording's moment of release."""
        super().__init__(family, limits, frame, story)
        self._series = series
        self._columns = {str(id_): i for i, id_ in enumerate(series["ids"])}
        self._next = int(np.searchsorted(series["time_s"], series["released_s"])) + 1

    def command(self, action: Sequence[float], frame: Frame, sim: SumoSimulation) -> None:
        """See `Adversaries.command`; the action counts after the end of the recording."""
        if self._next >= len(self._series["time_s"]):
            super().command(action, frame, sim)
            return
        vehicles = {id_: VehicleCommand(*self._row(id_, DRIVE)) for id_ in self._vehicles}
        walkers = {id_: Walker(*self._row(id_, WALK)) for id_ in self._pedestrians}
        for id_, walker in walkers.items():
            self._pedestrians[id_].state = walker
        finite = {id_: command for id_, command in vehicles.items() if np.isfinite(command).all()}
        sim.apply(finite, walkers, self._leads(self._series["actions"][self._next].tolist()))
        self._next += 1

    def keep_limits(self, frame: Frame) -> bool:
        """Continues from what was driven, which was judged when it was recorded."""
        super().keep_limits(frame)
        return True

    def _row(self, id_: str, names: Sequence[str]) -> list[float]:
        column = self._columns[id_]
        return [float(self._series[name][self._next, column]) for name in names]
