"""Adversaries too far away, or driving elsewhere, cannot reach the ego."""

import pytest

from risk_sac.failures.scenario_trial import out_of_reach
from risk_sac.scenario.check import scenes
from risk_sac.scenario.families import family_of
from risk_sac.scenario.interpret import Interpreter
from risk_sac.scenario.limits import limits_from_odd
from risk_sac.scenario.reading import document_from_fields, nets_of


def beyond(actor: dict[str, object], horizon_s: float = 2.0) -> list[str]:
    document = document_from_fields(
        {
            "name": "reach",
            "network": "low",
            "horizon_s": horizon_s,
            "ego": {"start": {"lane": "road_1", "at_m": 600}, "speed": 10},
            "actors": {"other": {"speed": 1, **actor}},
        }
    )
    nets = nets_of(document)
    of = Interpreter(document, nets)
    layouts = [of.layout(scene.values) for scene in scenes(of, 1)]
    return out_of_reach(layouts, limits_from_odd(family_of(document, nets).odd, 1.0))


@pytest.mark.parametrize(("at_m", "names"), [(100, ["other"]), (580, []), (620, []), (1000, ["other"])])
def test_vehicle_far_away_cannot_reach_the_ego(at_m: float, names: list[str]) -> None:
    assert beyond({"start": {"lane": "road_0", "at_m": at_m}}) == names


@pytest.mark.parametrize("left_m", [-40, -4, 4, 40])
def test_pedestrian_far_from_the_road_cannot_reach_it(left_m: float) -> None:
    start = {"lane": "road_1", "at_m": 620, "left_m": left_m, "heading_deg": 90}
    assert beyond({"body": "pedestrian", "start": start}) == (["other"] if abs(left_m) > 30 else [])


def test_longer_episode_brings_it_near() -> None:
    assert beyond({"start": {"lane": "road_0", "at_m": 100}}, horizon_s=60.0) == []
