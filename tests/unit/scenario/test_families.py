from itertools import combinations

import numpy as np
import pytest

from risk_sac.config import EgoConfig
from risk_sac.errors import InfeasibleScene
from risk_sac.scenario.bodies import BODIES
from risk_sac.scenario.families import FAMILIES, Family, family_of
from risk_sac.scenario.layout import LEAD_IN_S, Layout
from risk_sac.scenario.reading import nets_of, shipped_document
from risk_sac.sim.sumo import SumoSimulation
from risk_sac.world.types import Kind, Scene

LEAST_GAPS_M = {"low": 8.0, "mixed": 8.0, "dense": 8.0}  # between vehicles on one lane at the start
LEAST_GAP_M = 3.0  # in other documents
APPROACH_M = 230.4  # length of the roads to the intersection of dense

each_family = pytest.mark.parametrize("family", FAMILIES.values(), ids=FAMILIES)


@pytest.fixture(scope="module")
def sim():
    simulation = SumoSimulation(EgoConfig())
    yield simulation
    simulation.close()


def random_layouts(family: Family, seed: int, n: int) -> list[tuple[Scene, Layout]]:
    generator = np.random.default_rng(seed)
    layouts = list[tuple[Scene, Layout]]()
    while len(layouts) < n:
        scene = family.space.from_unit(generator.random(family.space.dimension))
        try:
            layouts.append((scene, family.layout(scene.values)))
        except InfeasibleScene as refused:
            if refused.reason != "constraint":
                raise
    return layouts


@each_family
def test_every_parameter_changes_the_layout(family):
    middle = np.full(family.space.dimension, 0.8)
    base = family.layout(family.space.from_unit(middle).values)
    for axis, name in enumerate(family.space.names):
        moved = middle.copy()
        moved[axis] = 0.3
        assert family.layout(family.space.from_unit(moved).values) != base, name


@each_family
def test_sumo_accepts_100_random_scenes_and_places_everybody_as_told(family, sim):
    for seed, (scene, layout) in enumerate(random_layouts(family, 1, 100)):
        frame = sim.reset(layout, seed)
        vehicles, pedestrians = (layout.ego, *layout.vehicles), layout.pedestrians
        moving = len(vehicles) + len(pedestrians)
        assert frame.ids == tuple(s.id for s in (*vehicles, *pedestrians, *layout.statics)), scene
        assert frame.kind.tolist()[:moving] == [Kind.VEHICLE] * len(vehicles) + [Kind.PEDESTRIAN] * len(pedestrians)
        assert all(np.isfinite(getattr(frame, name)).all() for name in ("x_m", "y_m", "heading_rad", "speed_mps"))
        # Placed, they have driven nothing yet; SUMO may not have changed the speed they were placed with.
        np.testing.assert_allclose(
            frame.speed_mps[:moving], [s.speed_mps for s in (*vehicles, *pedestrians)], atol=1e-6
        )


@each_family
def test_vehicles_on_one_lane_start_and_are_released_apart(family):
    for scene, layout in random_layouts(family, 5, 500):
        for a, b in combinations((layout.ego, *layout.vehicles), 2):
            if (a.route[0], a.lane) == (b.route[0], b.lane):
                ahead, behind = (a, b) if a.position_m > b.position_m else (b, a)
                gap_m = ahead.position_m - behind.position_m - BODIES[ahead.body].length_m
                assert gap_m >= LEAST_GAPS_M.get(family.name, LEAST_GAP_M) - 1e-9, (scene, ahead, behind)
                if family.name == "dense":
                    assert gap_m + LEAD_IN_S * (ahead.speed_mps - behind.speed_mps) >= 10.0 - 1e-9, (
                        scene,
                        ahead,
                        behind,
                    )


def dense_with(**changes: float) -> dict[str, float]:
    """Returns the distance of each dense vehicle's start to the stop line."""
    family = FAMILIES["dense"]
    middle = family.space.from_unit(np.full(family.space.dimension, 0.5)).values
    layout = family.layout(dict(middle) | changes)
    return {start.id: APPROACH_M - start.position_m for start in (layout.ego, *layout.vehicles)}


def test_background_traffic_makes_way_for_who_turns_right_from_its_lane():
    at = {"background_gap_m": 25.0, "from_right_distance_m": 50.0, "from_right_speed_mps": 9.0}
    elsewhere = dense_with(**at, from_right_turn=0.5)
    beside = dense_with(**at, from_right_turn=0.9)
    assert (elsewhere["east_0"], elsewhere["east_1"]) == pytest.approx((68.5, 93.5))  # at the release 55 and 80 m
    assert beside["from_right"] == elsewhere["from_right"] == pytest.approx(63.5)
    assert (beside["east_0"], beside["east_1"]) == pytest.approx((63.5 + 14.6, 93.5))
    others = beside.keys() - {"east_0"}
    assert {name: beside[name] for name in others} == pytest.approx({name: elsewhere[name] for name in others})


def test_background_traffic_without_room_behind_others_is_left_out():
    document = shipped_document("dense")
    north = document.streams["north"].model_copy(update={"from_m": 135.0})
    streams = {name: north if name == "north" else stream for name, stream in document.streams.items()}
    family = family_of(document.model_copy(update={"streams": streams}), nets_of(document))
    middle = family.space.from_unit(np.full(family.space.dimension, 0.5)).values
    names = [{start.id for start in family.layout({**middle, "background_gap_m": m}).vehicles} for m in (15.0, 40.0)]
    assert names[0] - names[1] == {"north_1"}
