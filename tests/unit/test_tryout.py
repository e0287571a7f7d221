from collections.abc import Iterator
from contextlib import closing

import pytest

from risk_sac.config import EgoConfig
from risk_sac.sim.sumo import SumoSimulation
from risk_sac.tryout import ALIKE_M, LEFT, MET_M, RIGHT, meet


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
