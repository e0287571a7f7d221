"""The ego brakes for what it sees, and only for that.

Each claim compares three runs of one scene: without the actor, with it hidden from the ego's models, and with it in
view. Swerving is a reaction too, so "no reaction" means the same trajectory to the last bit.
"""

import math
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass, replace

import numpy as np
import pytest

from risk_sac.config import EgoConfig
from risk_sac.scenario.families import FAMILIES
from risk_sac.scenario.layout import Layout, PedestrianStart, VehicleStart
from risk_sac.sim.solid import VehicleCommand
from risk_sac.sim.sumo import SumoSimulation
from risk_sac.world.geometry import relative_view
from risk_sac.world.types import Floats, Frame, Role
from tests.builders import Told, belief_of

LANE_Y_M = -1.65  # the ego's lane on the mixed road
GREEN_S, NEVER = 0.0, 10_000
MIXED = FAMILIES["mixed"].layout(FAMILIES["mixed"].space.from_unit(np.full(10, 0.5)).values)
DENSE_SPACE = FAMILIES["dense"].space


@dataclass
class Driven:
    """A simulation, and what its ego is told of the others."""

    sim: SumoSimulation
    told: Told


@contextmanager
def driven(config: EgoConfig) -> Iterator[Driven]:
    told = Told(lambda frame, _: belief_of(frame))
    with closing(SumoSimulation(config, told)) as sim:
        yield Driven(sim, told)


@pytest.fixture
def sim() -> Iterator[Driven]:
    with driven(EgoConfig()) as simulation:
        yield simulation


def car(
    id_: str, role: Role, position_m: float, speed_mps: float, edges: tuple[str, ...] = ("e1", "e2")
) -> VehicleStart:
    return VehicleStart(id=id_, role=role, route=edges, lane=2, position_m=position_m, speed_mps=speed_mps)


def on_the_mixed_road(ego: VehicleStart, *vehicles: VehicleStart, walker: tuple[float, float] | None = None) -> Layout:
    """Layout of the ego, a few others, and perhaps a standing pedestrian."""
    standing = () if walker is None else (walker,)
    return replace(
        MIXED,
        ego=ego,
        vehicles=vehicles,
        pedestrians=tuple(
            PedestrianStart(id="actor", role=Role.ADVERSARY, x_m=x, y_m=y, heading_rad=math.pi / 2, speed_mps=0.0)
            for x, y in standing
        ),
        signal_offset_s=GREEN_S,
    )


def drive(run: Driven, layout: Layout, *, seen_from: int = 0, steps: int = 110) -> list[Frame]:
    """Frames of a run; `actor` is hidden before `seen_from`, adversaries keep speed."""
    run.told.tell = lambda frame, step: belief_of(frame, hidden=() if step >= seen_from else ("actor",))
    sim = run.sim
    frames = [sim.reset(layout, 1)]
    sim.release()
    kept = {v.id: VehicleCommand(v.speed_mps, 0.0) for v in layout.vehicles if v.role is Role.ADVERSARY}
    for _ in range(steps):
        sim.apply(kept, {})
        frames.append(sim.step())
    return frames


def path(frames: list[Frame]) -> Floats:
    """The ego's x, y, heading and speed in every frame."""
    return np.array([(f.x_m[0], f.y_m[0], f.heading_rad[0], f.speed_mps[0]) for f in frames])


def least_gap(frames: list[Frame]) -> float:
    return min(float(relative_view(f).gap[f.ids.index("actor") - 1]) for f in frames)


def peak_braking(frames: list[Frame]) -> float:
    return max(-float(f.accel_mps2[0]) for f in frames)


def dense(*vehicles: VehicleStart) -> Layout:
    """The ego crosses the intersection straight from the south, on green."""
    middle = FAMILIES["dense"].layout(DENSE_SPACE.from_unit(np.full(DENSE_SPACE.dimension, 0.5)).values)
    ego = replace(middle.ego, position_m=middle.ego.position_m - 10.0, speed_mps=12.0)
    return replace(middle, ego=ego, vehicles=vehicles, pedestrians=(), signal_offset_s=GREEN_S)


ZEBRA_EGO, SIGNAL_EGO = car("ego", Role.EGO, 220.0, 12.0), car("ego", Role.EGO, 320.0, 12.0, ("e2", "e3"))
MIDBLOCK_EGO = car("ego", Role.EGO, 100.0, 12.0)
PARKED = car("actor", Role.ADVERSARY, 190.0, 0.0)
PEDESTRIANS = {
    "pedestrian on the roadway": (
        on_the_mixed_road(MIDBLOCK_EGO, walker=(190.0, LANE_Y_M)),
        on_the_mixed_road(MIDBLOCK_EGO),
    ),
    "pedestrian on the zebra": (
        on_the_mixed_road(ZEBRA_EGO, walker=(300.0, LANE_Y_M)),
        on_the_mixed_road(ZEBRA_EGO),
    ),
    "pedestrian on the signalised crossing": (
        on_the_mixed_road(SIGNAL_EGO, walker=(700.0, LANE_Y_M)),
        on_the_mixed_road(SIGNAL_EGO),
    ),
}


@pytest.mark.parametrize(("present", "absent"), PEDESTRIANS.values(), ids=PEDESTRIANS)
def test_the_ego_stops_for_a_pedestrian_from_the_moment_it_sees_it(
    sim: Driven, present: Layout, absent: Layout
) -> None:
    alone, seen, hidden = drive(sim, absent), drive(sim, present), drive(sim, present, seen_from=NEVER)
    assert least_gap(seen) > 0.2
    assert not np.array_equal(path(seen), path(alone))
    assert np.array_equal(path(hidden), path(alone))
    assert least_gap(hidden) == 0.0
    for seen_from in (15, 30):
        late = drive(sim, present, seen_from=seen_from)
        first = int(np.flatnonzero(np.any(path(late) != path(alone), axis=1))[0])
        assert first > seen_from  # nothing before it, bit for bit
        assert least_gap(late) > 0.0  # still far enough to stop or to pass


def test_a_hidden_pedestrian_does_not_hide_the_vehicle_beside_it(sim: Driven) -> None:
    other = replace(PARKED, id="parked", position_m=PARKED.position_m + 5)
    layout = on_the_mixed_road(MIDBLOCK_EGO, other, walker=(150.0, LANE_Y_M))
    frames = drive(sim, layout, seen_from=NEVER)
    gap = min(float(relative_view(f).gap[f.ids.index("parked") - 1]) for f in frames)
    assert least_gap(frames) == 0.0
    assert gap > 0.0


def test_a_pedestrian_off_the_road_does_not_stop_the_ego(sim: Driven) -> None:
    frames = drive(sim, on_the_mixed_road(MIDBLOCK_EGO, walker=(190.0, -8.0)))
    assert np.array_equal(path(frames), path(drive(sim, on_the_mixed_road(MIDBLOCK_EGO))))


def with_a_memory(run: Driven, layout: Layout, x_m: float, y_m: float) -> list[Frame]:
    """Frames of a run whose ego expects a standing `actor` there."""
    run.told.tell = lambda frame, _: belief_of(frame, expected={"actor": (x_m, y_m, 0.0, 0.0, 0.0)})
    return [run.sim.reset(layout, 1), *(run.sim.step() for _ in range(110))]


def test_a_remembered_pedestrian_is_braked_for_where_it_is_expected(sim: Driven) -> None:
    frames = with_a_memory(sim, on_the_mixed_road(MIDBLOCK_EGO, walker=(190.0, -8.0)), 190.0, LANE_Y_M)
    there = drive(sim, on_the_mixed_road(MIDBLOCK_EGO, walker=(190.0, LANE_Y_M)))
    assert np.array_equal(path(frames), path(there))
    assert frames[-1].x_m[0] < 190.0


@pytest.mark.parametrize("aside_m", [-6.0, 6.0])
def test_a_remembered_pedestrian_is_not_braked_for_where_it_is(sim: Driven, aside_m: float) -> None:
    layout = on_the_mixed_road(MIDBLOCK_EGO, walker=(190.0, LANE_Y_M))
    frames = with_a_memory(sim, layout, 190.0, LANE_Y_M + aside_m)
    assert np.array_equal(path(frames), path(drive(sim, on_the_mixed_road(MIDBLOCK_EGO))))
    assert least_gap(frames) == 0.0


@pytest.mark.parametrize("friction", [0.6, 1.0])
def test_braking_builds_up_to_the_grip_by_its_jerk(friction: float) -> None:
    layout = replace(on_the_mixed_road(MIDBLOCK_EGO, walker=(155.0, LANE_Y_M)), friction=friction)
    with driven(EgoConfig(reaction_time_s=0.1)) as sim:
        frames = drive(sim, layout, seen_from=25, steps=60)
    accel = np.array([float(f.accel_mps2[0]) for f in frames])
    assert accel[26:30] - accel[25] == pytest.approx([-1.265, -2.53, -3.795, -5.06], abs=1e-6)
    assert np.diff(np.maximum(-accel[25:], 0.0)).max() <= 1.265 + 1e-6  # before that, SUMO is free to dawdle
    assert accel.min() == pytest.approx(-min(friction * 9.81, 9.0), abs=1e-6)


@pytest.mark.parametrize("model", ["IDM", "ACC"])  # without dawdling, whose noise another vehicle would shift
def test_the_ego_stops_for_a_vehicle_ahead_from_the_moment_it_sees_it(model: str) -> None:
    with driven(EgoConfig(car_following=model)) as sim:
        occupied, alone = on_the_mixed_road(MIDBLOCK_EGO, PARKED), path(drive(sim, on_the_mixed_road(MIDBLOCK_EGO)))
        seen, hidden, late = (drive(sim, occupied, seen_from=step) for step in (0, NEVER, 25))
    assert least_gap(seen) > 0.2
    assert not np.array_equal(path(seen), alone)
    # SUMO can hide a vehicle from car following and at junctions, not from lane changing: only the speed is untouched.
    assert np.array_equal(path(hidden)[:, 3], alone[:, 3])
    assert least_gap(hidden) == 0.0
    assert np.flatnonzero(np.any(path(late) != alone, axis=1))[0] > 25


def red_light_runner(route: tuple[str, ...]) -> VehicleStart:
    """Arrives in the middle of the intersection together with the ego."""
    position_m = dense().ego.position_m + (22.0 if route[0] == "from_west" else 10.0)  # the east is further away
    return VehicleStart(id="actor", role=Role.ADVERSARY, route=route, lane=2, position_m=position_m, speed_mps=11.0)


@pytest.mark.parametrize("route", [("from_west", "to_east"), ("from_east", "to_west")])
def test_the_ego_brakes_for_a_vehicle_at_the_junction_that_it_sees(sim: Driven, route: tuple[str, ...]) -> None:
    crossed = dense(red_light_runner(route))
    seen, hidden = (drive(sim, crossed, seen_from=step, steps=90) for step in (0, NEVER))
    alone = drive(sim, dense(), steps=90)
    assert peak_braking(seen) > peak_braking(alone) + 3.0
    assert least_gap(seen) > 0.5
    assert np.array_equal(path(hidden), path(alone))
    assert least_gap(hidden) == 0.0


def behind_a_braking_leader(config: EgoConfig) -> list[Frame]:
    """The leader, 20 m ahead at 14 m/s, brakes after a second."""
    low = FAMILIES["low"].layout(FAMILIES["low"].space.from_unit(np.full(9, 0.5)).values)
    ego = replace(low.ego, speed_mps=14.0)
    lead = replace(low.vehicles[0], position_m=ego.position_m + 24.6, speed_mps=14.0, id="actor")
    with closing(SumoSimulation(config)) as sim:
        frames, speed = [sim.reset(replace(low, ego=ego, vehicles=(lead,), friction=1.0), 1)], 14.0
        sim.release()
        for step in range(100):
            speed = max(speed - 0.8, 0.0) if step >= 10 else speed
            sim.apply({"actor": VehicleCommand(speed, 0.0)}, {})
            frames.append(sim.step())
    return frames


def test_peak_braking_rises_with_the_reaction_time() -> None:
    peaks = [peak_braking(behind_a_braking_leader(EgoConfig(reaction_time_s=t))) for t in (0.1, 0.5, 1.0, 1.5)]
    assert peaks == sorted(peaks)
    assert peaks[0] < 5.0
    assert peaks[-1] > peaks[0] + 2.0


@pytest.mark.parametrize("model", ["Krauss", "EIDM", "CACC"])
def test_every_car_following_model_drives_and_reacts(model: str) -> None:
    frames = behind_a_braking_leader(EgoConfig(car_following=model))
    speeds = path(frames)[:, 3]
    assert speeds[:10].min() > 10.0
    assert peak_braking(frames) > 2.5
    assert speeds[-1] < 8.0 or path(frames)[-1, 1] != path(frames)[0, 1]  # nearly stopped, or gone round it
