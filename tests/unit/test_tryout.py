import math
from collections.abc import Iterator
from contextlib import closing

import pytest

from risk_sac.config import EgoConfig
from risk_sac.scenario.maps.finder import place_at
from risk_sac.scenario.maps.read_net import read_net
from risk_sac.sim.sumo import NETS, SumoSimulation
from risk_sac.tryout import ALIKE_M, LEFT, MET_M, RIGHT, Tried, meet


@pytest.mark.parametrize(
    ("left_m", "right_m", "says"),
    [
        (0.8, 0.9, None),
        (0.4, 1.5, "a pedestrian from the left is left 0.4 m, one from the right 1.5 m"),
        (0.0, 0.9, "a pedestrian from the left is touched"),
        (0.9, 0.0, "a pedestrian from the right is touched"),
        (0.0, 0.0, "a pedestrian from the left and from the right is touched"),
        (9.2, 18.3, "the ego meets no pedestrian within 12 s: it comes no nearer than 9.2 m"),
        (math.inf, math.inf, "the ego stands although nothing is in its way: no pedestrian can meet it"),
        (4.4, 18.3, "a pedestrian from the left is left 4.4 m, one from the right 18.3 m"),
    ],
)
def test_sides_that_are_not_alike_are_told_with_what_differs(left_m: float, right_m: float, says: str | None) -> None:
    fit = place_at(read_net(NETS / "low" / "low.net.xml"), "car_following", "road")
    assert Tried(fit, sides=(left_m, right_m)).unlike == says


@pytest.fixture(scope="module")
def sim() -> Iterator[SumoSimulation]:
    with closing(SumoSimulation(EgoConfig())) as simulation:
        yield simulation


@pytest.mark.parametrize("family", ["low", "mixed", "dense"])
def test_the_ego_meets_a_pedestrian_on_its_way_and_touches_none_from_either_side(
    sim: SumoSimulation, family: str
) -> None:
    left_m, right_m = (meet(sim, family, side) for side in (LEFT, RIGHT))
    assert 0.0 < min(left_m, right_m) < MET_M
    assert abs(left_m - right_m) <= ALIKE_M
