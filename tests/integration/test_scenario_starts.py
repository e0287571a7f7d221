"""Starts of a document's actors, in SUMO."""

from contextlib import closing

import pytest

from risk_sac.config import EgoConfig
from risk_sac.errors import ConfigError
from risk_sac.scenario.families import Family, family_of
from risk_sac.scenario.reading import document_from_fields, nets_of
from risk_sac.sim.sumo import SumoSimulation


def family(start: dict[str, object]) -> Family:
    document = document_from_fields(
        {
            "name": "aside",
            "network": "low",
            "ego": {"start": {"lane": "road_1", "at_m": 200}, "speed": 12},
            "actors": {"rider": {"body": "bicycle", "start": {"lane": "road_1", "at_m": 260} | start, "speed": 5}},
        }
    )
    return family_of(document, nets_of(document))


@pytest.mark.parametrize("left_m", [-1.0, 0.8])
def test_driver_keeps_beside_the_middle_of_its_lane(left_m: float) -> None:
    with closing(SumoSimulation(EgoConfig())) as sim:
        frame = sim.reset(family({"left_m": left_m}).layout({}), seed=1)
        for _ in range(15):
            assert frame.y_m[frame.ids.index("rider")] == pytest.approx(left_m, abs=0.01)
            frame = sim.step()


@pytest.mark.parametrize("start", [{"left_m": 1.7}, {"heading_deg": 90}])
def test_driver_starts_in_its_lane_and_along_it(start: dict[str, object]) -> None:
    (field,) = start
    with pytest.raises(ConfigError, match=rf"actors\.rider\.start\.{field}"):
        family(start)
