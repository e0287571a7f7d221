"""The drivers of an episode's vehicles, and what each is told before a step."""

import math

import libsumo

from risk_sac.scenario.layout import Layout
from risk_sac.sim.driver import OWN_CHOICE_MPS, Driver
from risk_sac.sim.ego import Belief
from risk_sac.sim.lookout import project
from risk_sac.sim.placing import emergency_decel_mps2
from risk_sac.sim.reading import Reading
from risk_sac.sim.roads import Roads
from risk_sac.types import STEP_S, Bools, Floats, Role

ASKEW_M = 0.1  # by which a corner of the ego may be beside where SUMO's models have it


class Drivers:
    """Tells the ego of everybody it knows of, and the others that SUMO drives of the pedestrians near them."""

    def __init__(self, layout: Layout, reaction_time_s: float, roads: Roads) -> None:
        """Takes every vehicle over that has been inserted.

        Args:
          layout: of the episode.
          reaction_time_s: the ego's.
          roads: that they drive on.
        """
        emergency = emergency_decel_mps2(layout.friction)
        cruise = {start.id: start.speed_mps for start in layout.vehicles if start.role is Role.ADVERSARY}
        self._others = {
            start.id: Driver(start.id, STEP_S, emergency, cruise.get(start.id, OWN_CHOICE_MPS))
            for start in layout.vehicles
        }
        self._released: dict[str, Driver] = {}
        self._ego: Driver | None = Driver(layout.ego.id, reaction_time_s, emergency)
        self._walkers = bool(layout.pedestrians)
        self._ego_id, self._wary = layout.ego.id, layout.wary
        self._roads = roads

    def release_ego(self) -> None:
        """Lets the ego's driver go: somebody else drives it."""
        self._ego = None

    def release(self, vehicle: str) -> None:
        """Lets a driver go, who from now on only intends."""
        self._released[vehicle] = self._others.pop(vehicle)

    def tell(self, reading: Reading, belief: Belief, braking_mps2: float) -> None:
        """Tells them what to do in the next step.

        Args:
          reading: what there is now.
          belief: what the ego makes of it.
          braking_mps2: how hard the ego is to brake at least.
        """
        if self._ego is not None:
            self._tell_ego(self._ego, reading, belief, braking_mps2)
        askew = self._wary and self._is_askew(reading)
        if not self._walkers and not self._wary:
            return
        candidates = reading.walks
        if askew:
            candidates = candidates.copy()
            candidates[0] = True
        for row, id_ in enumerate(reading.vehicles):
            driver = self._others.get(id_)
            if driver is not None and (askew or reading.near[row] or driver.telling):
                driver.wanted_mps2 = self._decide(driver, row, reading, reading.frame.state, candidates)
                driver.tell(*reading.speed_and_accel[row])

    def _is_askew(self, reading: Reading) -> bool:
        """Whether the ego's body reaches elsewhere than the box along its lane that SUMO's models go by."""
        frame = reading.frame
        _, _, way_rad = project(self._roads.along(self._ego_id).path.points, float(frame.x_m[0]), float(frame.y_m[0]))
        return abs(math.sin(float(frame.heading_rad[0]) - way_rad)) * float(frame.length_m[0]) / 2 > ASKEW_M

    def _tell_ego(self, ego: Driver, reading: Reading, belief: Belief, braking_mps2: float) -> None:
        speed, accel = reading.speed_and_accel[0]
        if ego.due:
            ego.wanted_mps2 = self._decide(ego, 0, reading, belief.state, belief.known)
        ego.tell(speed, accel)
        if braking_mps2:
            ego.brake(speed, accel, braking_mps2)

    def intended_accel(self, reading: Reading) -> dict[str, float]:
        """What the drivers of the released vehicles would do if nobody commanded them, m/s².

        They keep the speed they started with, or go slower where SUMO's models or a pedestrian in their way want that.
        SUMO's wish is that of the step before, which is the newest it tells.
        """
        found = {}
        for id_, driver in self._released.items():
            row = reading.row.get(id_)
            if row is None:  # left the net
                continue
            speed, accel = reading.speed_and_accel[row]
            models = (libsumo.vehicle.getSpeedWithoutTraCI(id_) - speed) / STEP_S + accel
            wanted = min(models, max(driver.cruise_mps - speed, 0.0) / STEP_S)
            told = None
            if reading.near[row]:
                told = self._decide(driver, row, reading, reading.frame.state, reading.walks)
            found[id_] = wanted if told is None else min(wanted, told)
        return found

    def _decide(self, driver: Driver, row: int, reading: Reading, state: Floats, candidates: Bools) -> float | None:
        along = self._roads.along(reading.vehicles[row])
        return driver.decide(row, reading.speed_and_accel[row][0], along, state, reading.drives, candidates)
