import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from risk_sac.config import Interval
from risk_sac.errors import SceneError
from risk_sac.scenario.space import Parameter, SceneSpace
from risk_sac.types import Scene

SPACE = SceneSpace(
    "low",
    (
        Parameter("gap_m", "m", 5.0, 45.0, "gap to the leader"),
        Parameter("speed_mps", "m/s", 0.1, 0.7, "speed of the leader", "dynamic.vehicle_speed_mps"),
        Parameter("lane", "1", 1.0, 1.0, "a parameter without room"),
    ),
)


def test_the_cubes_corners_are_the_bounds() -> None:
    assert SPACE.dimension == 3
    assert SPACE.names == ("gap_m", "speed_mps", "lane")
    assert SPACE.from_unit(np.zeros(3)).values == {"gap_m": 5.0, "speed_mps": 0.1, "lane": 1.0}
    assert SPACE.from_unit(np.ones(3)).values == {"gap_m": 45.0, "speed_mps": 0.7, "lane": 1.0}
    assert SPACE.from_unit(np.array([0.25, 0.5, 0.3])).values["gap_m"] == 15.0


@given(arrays(np.float64, 3, elements=st.floats(0, 1)))
def test_a_point_comes_back_from_its_scene(point: np.ndarray) -> None:
    scene = SPACE.from_unit(point)
    SPACE.check(scene)
    np.testing.assert_allclose(SPACE.to_unit(scene)[:2], point[:2], atol=1e-12)
    assert SPACE.to_unit(scene)[2] == 0.0


@pytest.mark.parametrize(
    ("family", "change", "message"),
    [
        ("dense", {}, "family 'dense'; wanted 'low'"),
        ("low", {"gap_m": 50.0}, r"gap_m is 50 m; the 'low' family allows \[5, 45\]"),
        ("low", {"gap_m": float("nan")}, "gap_m is nan"),
        ("low", {"speed_mps": float("inf")}, "speed_mps is inf"),
        ("low", {"spede_mps": 0.5}, r"unknown parameters \['spede_mps'\]"),
        ("low", {"lane": None}, r"lacks \['lane'\]"),
    ],
)
def test_scenes_outside_the_space_are_refused(family: str, change: dict[str, float | None], message: str) -> None:
    values = {"gap_m": 10.0, "speed_mps": 0.5, "lane": 1.0} | change
    scene = Scene(family, {name: value for name, value in values.items() if value is not None})
    with pytest.raises(SceneError, match=message):
        SPACE.check(scene)


def test_narrowing_intersects_and_keeps_the_rest() -> None:
    narrowed = SPACE.narrow({"gap_m": Interval(low=-10, high=20)})
    assert [(p.low, p.high) for p in narrowed.parameters] == [(5.0, 20.0), (0.1, 0.7), (1.0, 1.0)]
    assert SPACE.narrow({}) == SPACE
