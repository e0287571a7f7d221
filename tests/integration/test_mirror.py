"""The ego stops for what it sees, on either side.

Each scene is driven twice, the second time mirrored about the ego's path. A test of one side is no test: SUMO's own
drivers stop for a pedestrian from the left kerb and drive over the one from the right.
"""

import math
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import dataclass, replace

import libsumo
import numpy as np
import pytest

from risk_sac.config import EgoConfig
from risk_sac.scenario.families import FAMILIES
from risk_sac.scenario.layout import Layout, PedestrianStart, VehicleStart
from risk_sac.sim.paths import STATION
from risk_sac.sim.solid import Walker
from risk_sac.sim.sumo import SumoSimulation
from risk_sac.world.geometry import relative_view
from risk_sac.world.types import STEP_S, Frame, Role

LEFT, RIGHT = 1, -1
CONDITIONS = ((5.0, 1.0), (9.5, 0.6), (13.8, 1.0))  # speed in m/s, friction
REACTION_S = 0.5
BUILD_UP_S = 0.36  # 4.5 m/s² at 12.65 m/s³
PACES_MPS = {"walking": 1.4, "running": 3.0, "standing": 0.0, "turning back": 1.4}


def middle(family: str) -> Layout:
    space = FAMILIES[family].space
    return replace(
        FAMILIES[family].layout(space.from_unit(np.full(space.dimension, 0.5)).values),
        vehicles=(),
        pedestrians=(),
        signal_offset_s=0.0,  # green for the ego
    )


LOW, MIXED, DENSE = middle("low"), middle("mixed"), middle("dense")


@dataclass(frozen=True)
class Place:
    """Stretch of the ego's path with a place where an actor interferes."""

    layout: Layout
    route: tuple[str, ...]
    lane: int
    station_m: float
    fastest_mps: float = 13.8
    aside_m: float = 6.0  # from where pedestrians come


PLACES = {
    "zebra": Place(MIXED, ("e1", "e2"), 2, 300.0),
    "signalised crossing": Place(MIXED, ("e2", "e3"), 2, 398.0),
    "roadway": Place(MIXED, ("e2", "e3"), 2, 200.0),
    "half a metre beside a crossing": Place(MIXED, ("e1", "e2"), 2, 297.5),
    "junction, straight on": Place(DENSE, ("from_south", "to_north"), 2, 250.0),
    "junction, turning left": Place(DENSE, ("from_south", "to_west"), 2, 245.0, 8.0, 4.0),
    "junction, turning right": Place(DENSE, ("from_south", "to_east"), 1, 239.0, 8.0, 4.0),
}


@dataclass(frozen=True)
class Drive:
    """What came of one."""

    touched: bool
    stood: bool
    least_m: float


@pytest.fixture(scope="module")
def sim() -> Iterator[SumoSimulation]:
    with closing(SumoSimulation(EgoConfig(reaction_time_s=REACTION_S))) as simulation:
        yield simulation


def drive(sim: SumoSimulation, steps: int, before_step: Callable[[float], None]) -> Drive:
    touched, stood, least_m = False, False, math.inf
    for step in range(steps):
        before_step(step * STEP_S)
        frame = sim.step()
        view = relative_view(frame)
        least_m = min(least_m, float(view.gap[0]))
        touched |= bool(view.overlap[0])
        stood |= frame.ego_speed_mps < 0.3
    return Drive(touched, stood, least_m)


def pose(sim: SumoSimulation, station_m: float, aside_m: float) -> tuple[float, float, float]:
    """Pose of a point beside the ego's path, positive to the left."""
    path = sim.along("ego").path
    i = min(max(int(np.searchsorted(path[STATION], station_m)) - 1, 0), path.shape[1] - 2)
    x_m, y_m, start_m, heading = path[:4, i]
    along = station_m - start_m
    cos, sin = math.cos(heading), math.sin(heading)
    return x_m + along * cos - aside_m * sin, y_m + along * sin + aside_m * cos, heading


def meet_pedestrian(
    sim: SumoSimulation, place: Place, side: int, motion: str, speed_mps: float, friction: float
) -> Drive:
    """A pedestrian meets an ego that keeps its speed, or stands."""
    pace = PACES_MPS[motion]
    aside_m = place.aside_m if pace else 0.0
    before_m = max(4.0 * speed_mps + 5.0, 35.0)
    ego = VehicleStart(
        id="ego",
        role=Role.EGO,
        route=place.route,
        lane=place.lane,
        position_m=place.station_m - before_m,
        speed_mps=speed_mps,
    )
    layout = replace(place.layout, ego=ego, friction=friction)
    sim.reset(layout, 1)
    x, y, path_heading = pose(sim, place.station_m, side * aside_m)
    towards = path_heading - side * math.pi / 2
    start = PedestrianStart(id="walker", role=Role.ADVERSARY, x_m=x, y_m=y, heading_rad=towards, speed_mps=0.0)
    sim.reset(replace(layout, pedestrians=(start,)), 1)
    sets_off_s = max(before_m / speed_mps - aside_m / pace, 0.0) if pace else math.inf
    turns_s = sets_off_s + (aside_m - 1.6) / pace if motion == "turning back" else math.inf
    walker = Walker(x, y, towards, 0.0)

    def walk(time_s: float) -> None:
        nonlocal walker
        back = time_s >= turns_s + 1.0
        heading = towards + math.pi * back
        speed = pace if back or sets_off_s <= time_s < turns_s else 0.0
        step_m = speed * STEP_S
        walker = Walker(
            walker.x_m + step_m * math.cos(heading), walker.y_m + step_m * math.sin(heading), heading, speed
        )
        sim.apply({}, {"walker": walker})

    return drive(sim, 120, walk)


def has_the_distance(speed_mps: float, warning_s: float) -> bool:
    """Whether the warning time suffices for reaction and stopping at 4.5 m/s²."""
    return speed_mps * warning_s >= speed_mps * (REACTION_S + BUILD_UP_S) + speed_mps**2 / 9.0 + 2.5


@pytest.mark.parametrize("motion", PACES_MPS)
@pytest.mark.parametrize("where", PLACES)
def test_pedestrians_from_either_side_are_alike(sim: SumoSimulation, where: str, motion: str) -> None:
    place = PLACES[where]
    for speed, friction in CONDITIONS:
        if speed > place.fastest_mps:
            continue
        left, right = (meet_pedestrian(sim, place, side, motion, speed, friction) for side in (LEFT, RIGHT))
        assert (left.touched, left.stood) == (right.touched, right.stood), (speed, friction, left, right)
        assert left.least_m == pytest.approx(right.least_m, abs=0.3), (speed, friction)
        pace = PACES_MPS[motion]
        if not pace or has_the_distance(speed, place.aside_m / pace):
            assert not left.touched, (speed, friction, left)


def meet_vehicle(sim: SumoSimulation, side: int, kind: str, speed_mps: float, friction: float) -> Drive:
    """Meets another vehicle, moved as told; the ego keeps its lane.

    Otherwise SUMO's rule to overtake on the left would make the sides differ.
    """
    here = VehicleStart(id="ego", role=Role.EGO, route=("road",), lane=1, position_m=200.0, speed_mps=speed_mps)
    other = VehicleStart(id="other", role=Role.ADVERSARY, route=("road",), lane=0, position_m=260.0, speed_mps=0.0)
    frame: Frame = sim.reset(replace(LOW, ego=here, vehicles=(other,), friction=friction), 1)
    sim.release()
    libsumo.vehicle.setLaneChangeMode("ego", 0)
    ahead_m = max(40.0, 4.0 * speed_mps)
    x, y = float(frame.x_m[0]), float(frame.y_m[0])
    start = {
        "standing across": (ahead_m, 1.0, math.pi / 2, 0.0),
        "standing tilted": (ahead_m, 1.8, -math.radians(15), 0.0),
        "cutting in": (10.0 + speed_mps, 3.3, 0.0, speed_mps - 2.0),
        "turning from the oncoming lane": (ahead_m, 8.0, math.pi + math.radians(60), 6.0),
    }[kind]
    x, y, heading, speed = x + start[0], y + side * start[1], start[2] if start[2] == 0 else side * start[2], start[3]
    heading = math.pi + side * math.radians(60) if kind.startswith("turning") else heading

    def move(time_s: float) -> None:
        nonlocal x, y
        vx, vy = speed * math.cos(heading), speed * math.sin(heading)
        if kind == "cutting in" and 1.0 <= time_s < 1.0 + 3.3 / 1.2:
            vy = -side * 1.2
        x, y = x + vx * STEP_S, y + vy * STEP_S
        front_x, front_y = x + 2.3 * math.cos(heading), y + 2.3 * math.sin(heading)
        libsumo.vehicle.moveToXY("other", "", -1, front_x, front_y, 90.0 - math.degrees(heading), keepRoute=2)

    return drive(sim, 70, move)


@pytest.mark.parametrize("kind", ["standing across", "standing tilted", "cutting in", "turning from the oncoming lane"])
def test_vehicles_from_either_side_are_alike(sim: SumoSimulation, kind: str) -> None:
    for speed, friction in CONDITIONS:
        left, right = (meet_vehicle(sim, side, kind, speed, friction) for side in (LEFT, RIGHT))
        assert (left.touched, left.stood) == (right.touched, right.stood), (speed, friction, left, right)
        assert left.least_m == pytest.approx(right.least_m, abs=0.3), (speed, friction)
        assert not left.touched, (speed, friction, left)
