"""Decides what SUMO's drivers stop for or follow in the next step.

The distance is ours; the speed for it comes from the driver's own car-following model (`getStopSpeed`,
`getFollowSpeed`). The smaller of that and of what SUMO's models want anyway is driven.
"""

import math
from collections.abc import Iterable, Sequence

import libsumo

from risk_sac.scenario.layout import Layout, StaticStart
from risk_sac.scenario.limits import emergency_decel_mps2
from risk_sac.sim.ego import Belief
from risk_sac.sim.lookout import project, targets
from risk_sac.sim.paths import CAR, Along, car_may_use
from risk_sac.sim.pilot import MovedVehicle
from risk_sac.sim.reading import Reading
from risk_sac.sim.roads import KEEP_ROUTE, Roads
from risk_sac.world.types import STEP_S, Bools, Floats, Role

ASKEW_M = 0.1  # distance of the ego's corner from where SUMO's models have it above which it is askew

NORMAL_DECEL_MPS2 = 4.5  # deceleration that SUMO assumes of a leader, and its default for passenger cars
JERK_MPS3 = 12.65  # jerk with which a braking builds up (UN R157's driver)
BUILD_UP_S = NORMAL_DECEL_MPS2 / JERK_MPS3  # time that braking takes to build up; the model leaves it out
OWN_CHOICE_MPS = -1.0  # value by which SUMO's models choose the speed
SAFE_MODE = 31  # all checks of SUMO; commanded speeds are then held to the normal deceleration
EMERGENCY_MODE = 26  # SUMO's checks without those of safe speed and of deceleration


class SumoDriver:
    """Driver of one vehicle that SUMO drives; decides once per reaction time.

    SUMO's models do so too.

    Attributes:
      telling: whether it is held to a speed at present.
      cruise_mps: its commanded speed where nothing else binds; below 0 SUMO chooses.
      period: its reaction time in steps.
      step: how many there have been.
      wanted_mps2: the acceleration that it decided on; None if nothing binds it.
    """

    def __init__(
        self, vehicle: str, reaction_s: float, emergency_mps2: float, cruise_mps: float = OWN_CHOICE_MPS
    ) -> None:
        """Looks up the vehicle's model; braking is at most `emergency_mps2`."""
        self._vehicle = vehicle
        self.cruise_mps = cruise_mps
        self.period = round(reaction_s / STEP_S)
        self._emergency_mps2 = emergency_mps2
        self.step = 0
        self.wanted_mps2: float | None = None
        self.telling = False
        get = libsumo.vehicle
        get.setSpeed(vehicle, cruise_mps)
        self._accel, self._min_gap = get.getAccel(vehicle), get.getMinGap(vehicle)

    def tell(self, speed_mps: float, accel_mps2: float) -> None:
        """Tells SUMO the vehicle's greatest next speed, given its speed and acceleration."""
        self.step += 1
        if self.wanted_mps2 is None:
            if self.telling:
                libsumo.vehicle.setSpeedMode(self._vehicle, SAFE_MODE)
                libsumo.vehicle.setSpeed(self._vehicle, self.cruise_mps)
                self.telling = False
            return
        self._hold_to(self.wanted_mps2, speed_mps, accel_mps2)

    def brake(self, speed_mps: float, accel_mps2: float, braking_mps2: float) -> None:
        """Makes it brake by at least `braking_mps2` in the next step.

        That holds whatever its command was.
        """
        accel = -min(braking_mps2, self._emergency_mps2)
        if self.wanted_mps2 is None or accel < self.wanted_mps2:
            self._hold_to(accel, speed_mps, accel_mps2)

    def _hold_to(self, wanted_mps2: float, speed_mps: float, accel_mps2: float) -> None:
        """Tells SUMO the speed after a step of this acceleration, jerk limited."""
        self.telling = True
        accel = max(wanted_mps2, min(accel_mps2, 0.0) - JERK_MPS3 * STEP_S)
        libsumo.vehicle.setSpeedMode(self._vehicle, EMERGENCY_MODE if accel < -NORMAL_DECEL_MPS2 else SAFE_MODE)
        libsumo.vehicle.setSpeed(self._vehicle, max(speed_mps + accel * STEP_S, 0.0))

    def decide(
        self, own: int, speed: float, along: Along, state: Floats, vehicle: Bools, candidate: Bools
    ) -> float | None:
        """Returns its model's acceleration for the nearest of `targets`; None if unbound."""
        path, station_m, offset_m, _ = along
        obstacles = targets(path, station_m, offset_m, own, self._accel, state, vehicle, candidate)
        if not len(obstacles):
            return None
        wanted = math.inf
        for _, gap_m, lead_mps in obstacles.tolist():
            room_m = gap_m - self._min_gap - BUILD_UP_S * max(speed - lead_mps, 0.0)
            wanted = min(wanted, self._worth(speed, room_m, lead_mps))
        if wanted >= speed + self._accel * STEP_S or 0.0 <= self.cruise_mps <= wanted:
            return None
        return max((wanted - speed) / STEP_S, -self._emergency_mps2)

    def _worth(self, speed: float, gap_m: float, lead_mps: float) -> float:
        """The speed of its car-following model for a gap."""
        gap_m = max(gap_m, 0.0)
        if lead_mps > 0.0:
            return float(libsumo.vehicle.getFollowSpeed(self._vehicle, speed, gap_m, lead_mps, NORMAL_DECEL_MPS2))
        return float(libsumo.vehicle.getStopSpeed(self._vehicle, speed, gap_m))


class Drivers:
    """Informs SUMO's drivers of the actors that they know.

    The ego gets all actors that it knows of, the others the pedestrians and static bodies near them.
    """

    def __init__(self, layout: Layout, reaction_time_s: float, roads: Roads) -> None:
        """Makes drivers for all inserted vehicles; the reaction time is the ego's."""
        emergency = emergency_decel_mps2(layout.friction)
        cruise = {start.id: start.speed_mps for start in layout.vehicles if start.role is Role.ADVERSARY}
        self._others = {
            start.id: SumoDriver(start.id, STEP_S, emergency, cruise.get(start.id, OWN_CHOICE_MPS))
            for start in layout.vehicles
            if start.role is not Role.STORY
        }
        self._released: dict[str, SumoDriver] = {}
        self._ego: SumoDriver | None = SumoDriver(layout.ego.id, reaction_time_s, emergency)
        self._outsiders = bool(layout.pedestrians or layout.statics)
        self._ego_id, self._wary = layout.ego.id, layout.wary
        self._roads = roads
        self._outside: list[str] = []  # vehicles that SUMO's models do not see where they are

    def release_ego(self) -> None:
        """Drops the ego's driver: a pilot drives it."""
        self._ego = None

    def release(self, vehicle: str) -> None:
        """Stops telling a vehicle; its driver is only asked what it intends."""
        self._released[vehicle] = self._others.pop(vehicle)

    def tell(
        self,
        reading: Reading,
        belief: Belief,
        braking_mps2: float,
        moved: MovedVehicle | None = None,
        beside: Sequence[str] = (),
    ) -> None:
        """Tells all drivers what to do in the next step.

        SUMO's models see what is on their lanes. For a body that is elsewhere, drivers look out themselves.

        Args:
          reading: the latest.
          belief: the ego's.
          braking_mps2: least braking of an ego that SUMO drives.
          moved: the ego, if a pilot drives it.
          beside: vehicles that SUMO does not drive and that are beside lanes.
        """
        if self._ego is not None:
            self._tell_ego(self._ego, reading, belief, braking_mps2)
        before, self._outside = self._outside, [*beside]
        if moved is not None and not moved.inside:
            self._outside.append(self._ego_id)
        hidden = self._outside
        if self._wary and self._ego_id not in hidden and self._is_askew(reading, moved):
            hidden = [*hidden, self._ego_id]
        if not (self._outsiders or self._wary or hidden or before):
            return
        candidates = _with(hidden, reading)
        for row, id_ in enumerate(reading.vehicles):
            driver = self._others.get(id_)
            if driver is not None and (hidden or reading.near[row] or driver.telling):
                driver.wanted_mps2 = self._decide(driver, row, reading, reading.frame.state, candidates)
                driver.tell(*reading.speed_and_accel[row])

    def _is_askew(self, reading: Reading, moved: MovedVehicle | None) -> bool:
        """Whether the ego's body reaches beyond SUMO's box along its lane."""
        frame = reading.frame
        along = self._roads.along(self._ego_id) if moved is None else moved.along
        _, _, way_rad = project(along.path, float(frame.x_m[0]), float(frame.y_m[0]))
        return abs(math.sin(float(frame.heading_rad[0]) - way_rad)) * float(frame.length_m[0]) / 2 > ASKEW_M

    def _tell_ego(self, ego: SumoDriver, reading: Reading, belief: Belief, braking_mps2: float) -> None:
        speed, accel = reading.speed_and_accel[0]
        if ego.step % ego.period == 0:
            ego.wanted_mps2 = self._decide(ego, 0, reading, belief.state, belief.known)
        ego.tell(speed, accel)
        if braking_mps2:
            ego.brake(speed, accel, braking_mps2)

    def intended_accel(self, reading: Reading) -> dict[str, float]:
        """Accelerations that released vehicles' drivers would choose without commands, m/s².

        They keep the speed they started with, or drive slower for SUMO's models or a pedestrian. SUMO's wish is that of
        the step before, the newest it tells.
        """
        accel_by_id = {}
        for id_, driver in self._released.items():
            row = reading.row.get(id_)
            if row is None:  # left the net
                continue
            speed, accel = reading.speed_and_accel[row]
            models = (libsumo.vehicle.getSpeedWithoutTraCI(id_) - speed) / STEP_S + accel
            wanted = min(models, max(driver.cruise_mps - speed, 0.0) / STEP_S)
            told = None
            if self._outside or reading.near[row]:
                told = self._decide(driver, row, reading, reading.frame.state, _with(self._outside, reading))
            accel_by_id[id_] = wanted if told is None else min(wanted, told)
        return accel_by_id

    def _decide(self, driver: SumoDriver, row: int, reading: Reading, state: Floats, candidates: Bools) -> float | None:
        along = self._roads.along(reading.vehicles[row])
        return driver.decide(row, reading.speed_and_accel[row][0], along, state, reading.drives, candidates)


def _with(vehicles: Sequence[str], reading: Reading) -> Bools:
    """Adds vehicles to the actors that drivers look out for."""
    rows = [reading.row[id_] for id_ in vehicles if id_ in reading.row]
    if not rows:
        return reading.outside
    candidates = reading.outside.copy()
    candidates[rows] = True
    return candidates


LEAST_M = 0.05  # of a body's width in the lane; less hinders no vehicle
ALONG_RAD = 0.35  # greatest angle to the lane of a body that a stand-in along the lane can stand for; choice


def stand_in_lanes(statics: Iterable[StaticStart]) -> frozenset[str]:
    """Inserts stand-ins of static bodies, and returns the ids that have one.

    A static body is no vehicle of SUMO's. One that stands along a lane gets a stand-in there, so that SUMO's
    lane-change models know of it and drivers pass it. The stand-in is never read.
    """
    return frozenset(start.id for start in statics if _stand_in(start))


def _stand_in(start: StaticStart) -> bool:
    """Inserts a stand-in if the body reaches into a lane along it."""
    body = start.shape
    edge, centre_m, index = libsumo.simulation.convertRoad(start.x_m, start.y_m, False, CAR)
    lane = f"{edge}_{index}"
    if not edge or edge.startswith(":"):
        return False
    x, y = libsumo.simulation.convert2D(edge, centre_m, index)
    way_rad = math.radians(90.0 - libsumo.lane.getAngle(lane, centre_m))
    dx, dy = start.x_m - x, start.y_m - y
    right_m, left_m = _inside(edge, index, dy * math.cos(way_rad) - dx * math.sin(way_rad), body.width_m / 2)
    front_m = centre_m + body.length_m / 2
    inside = left_m - right_m > LEAST_M and body.length_m < front_m < libsumo.lane.getLength(lane)
    if not inside or abs(math.sin(start.heading_rad - way_rad)) > math.sin(ALONG_RAD):
        return False
    route = f"stands_{edge}"
    if route not in libsumo.route.getIDList():
        libsumo.route.add(route, [edge])
    vehicle, offset_m = libsumo.vehicle, (right_m + left_m) / 2
    vehicle.add(start.id, route, "background_car", departLane=str(index), departPos=repr(front_m), departSpeed="0")
    vehicle.setLength(start.id, body.length_m)
    vehicle.setWidth(start.id, left_m - right_m)
    vehicle.setSpeed(start.id, 0.0)
    vehicle.setLaneChangeMode(start.id, 0)
    x, y = x + (body.length_m / 2) * math.cos(way_rad), y + (body.length_m / 2) * math.sin(way_rad)
    x, y = x - offset_m * math.sin(way_rad), y + offset_m * math.cos(way_rad)
    vehicle.moveToXY(start.id, edge, index, x, y, keepRoute=KEEP_ROUTE)
    return True


def _inside(edge: str, index: int, offset_m: float, half_m: float) -> tuple[float, float]:
    """Clips a body's lateral ends, right and left, to the carriageway."""
    lane_m, lanes = libsumo.lane.getWidth(f"{edge}_{index}") / 2, libsumo.edge.getLaneNumber(edge)
    drivable = [0 <= beside < lanes and car_may_use(f"{edge}_{beside}") for beside in (index - 1, index + 1)]
    right_m, left_m = offset_m - half_m, offset_m + half_m
    return right_m if drivable[0] else max(right_m, -lane_m), left_m if drivable[1] else min(left_m, lane_m)
