"""All adversaries of an episode: splits the joint action in [-1, 1], and checks what was driven.

Vehicles take (longitudinal acceleration, lateral velocity), pedestrians (acceleration, heading rate).
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from risk_sac.scenario.family import Family
from risk_sac.scenario.limits import Limits
from risk_sac.sim.commands import Walker
from risk_sac.sim.pedestrian_control import PedestrianControl
from risk_sac.sim.sumo import SumoSimulation
from risk_sac.sim.vehicle_control import VehicleControl
from risk_sac.types import LATERAL, SPEED, VX, VY, Floats, Frame

TOLERANCE_MPS = 0.02  # SUMO's rounding, divided by the step
LEAP_MPS = 4.0  # at a corner of a coarsely drawn lane, a body off its middle moves up to 0.3 m more or less in a step


class Adversaries:
    """All adversaries of an episode: splits the joint action, and checks what was driven."""

    def __init__(self, family: Family, limits: Limits, frame: Frame) -> None:
        """The controls go on from the motion in `frame`."""
        f, rows = frame, {id_: row for row, id_ in enumerate(frame.ids)}
        self._limits = limits
        self._vehicles = {
            id_: VehicleControl(limits, *(float(a[rows[id_]]) for a in (f.speed_mps, f.accel_mps2, f.lateral_mps)))
            for id_ in family.vehicles
        }
        self._pedestrians = {}
        for id_ in family.pedestrians:
            walker = Walker(*(float(a[rows[id_]]) for a in (f.x_m, f.y_m, f.heading_rad, f.speed_mps)))
            self._pedestrians[id_] = PedestrianControl(limits, walker)
        self._order = family.adversaries
        self._ids: tuple[str, ...] = ()

    def command(self, action: Sequence[float], sim: SumoSimulation) -> None:
        """Sends one joint action, two entries per adversary in the family's order."""
        first, second = action[::2], action[1::2]
        intended = sim.intended_accel()
        vehicles = {}
        for k, (id_, control) in enumerate(self._vehicles.items()):
            place = sim.place(id_)
            if place is not None:
                vehicles[id_] = control.step(first[k], second[k], *place, intended[id_])
        k = len(self._vehicles)
        walkers = {
            id_: control.step(first[k + j], second[k + j]) for j, (id_, control) in enumerate(self._pedestrians.items())
        }
        sim.apply(vehicles, walkers)

    def rows(self, frame: Frame) -> NDArray[np.intp]:
        """Rows of the frame that hold adversaries."""
        if frame.ids is not self._ids:
            self._ids = frame.ids
            present = [id_ for id_ in self._order if id_ in frame.ids]
            self._rows = np.array([frame.ids.index(id_) for id_ in present], dtype=np.intp)
            self._driven = [(frame.ids.index(id_), self._vehicles[id_]) for id_ in present if id_ in self._vehicles]
            vehicle_limit = max(self._limits.accel_mps2, self._limits.brake_mps2)
            walker_limit = max(self._limits.walk_accel_mps2, self._limits.walk_brake_mps2)
            limits = [vehicle_limit if id_ in self._vehicles else walker_limit for id_ in present]
            self._accel_limits = np.array(limits)
        return self._rows

    def accel_limits(self, frame: Frame) -> Floats:
        """Greatest absolute acceleration of each actor in `rows`, m/s²."""
        self.rows(frame)
        return self._accel_limits

    def keep_limits(self, frame: Frame) -> bool:
        """Whether every adversary vehicle drove as commanded, and so inside its limits, and was nowhere else.

        Less lateral motion than commanded passes: SUMO pauses it for some steps where a vehicle enters a junction.
        Pedestrians move by our own dynamics and cannot deviate. The controls go on from what was driven: who is too
        fast for a bend when it is released is commanded to brake, and keeps its limits if it does.
        """
        self.rows(frame)
        kept = True
        for row, control in self._driven:
            driven = frame.state[:, row].tolist()
            speed, lateral = driven[SPEED], driven[LATERAL]
            kept &= abs(speed - control.speed_mps) <= TOLERANCE_MPS
            kept &= abs(lateral) <= abs(control.lateral_mps) + TOLERANCE_MPS
            moved = math.hypot(driven[VX], driven[VY])
            kept &= abs(moved - math.hypot(speed, lateral)) <= LEAP_MPS
            control.speed_mps, control.lateral_mps = speed, lateral
        return kept
