"""The grid of a scene space, against grids written out by hand."""

import pytest

from risk_sac.config.scenario import ScenarioParameter
from risk_sac.errors import ConfigError
from risk_sac.scenario.space import DEFAULT_LEVELS, Grid, Parameter, SceneSpace, grid_of

STATED = {
    "speed": ScenarioParameter(range=(0.1, 0.7), step=0.3),
    "road": ScenarioParameter(words=("dry", "wet")),
    "gap": ScenarioParameter(range=(10, 30)),
    "mass": ScenarioParameter(range=(5, 5)),
}


def grid(**bounds: tuple[float, float]) -> Grid:
    ranges = {name: parameter.range or (0.0, 1.0) for name, parameter in STATED.items()} | bounds
    space = SceneSpace("made_up", tuple(Parameter(name, "1", *ends, name) for name, ends in ranges.items()))
    return grid_of(space, STATED)


def test_the_grid_has_all_steps_words_and_default_values():
    made = grid()
    assert made.size == 3 * 2 * DEFAULT_LEVELS
    points = [tuple(made.values(number).values()) for number in range(made.size)]
    assert points[:6] == [
        (0.1, 0.25, 10, 5),
        (0.1, 0.25, 15, 5),
        (0.1, 0.25, 20, 5),
        (0.1, 0.25, 25, 5),
        (0.1, 0.25, 30, 5),
        (0.1, 0.75, 10, 5),
    ]
    assert sorted({speed for speed, *_ in points}) == [0.1, 0.4, 0.7]
    assert len(set(points)) == made.size
    assert made.unstated == ("gap",)


def test_an_odd_narrows_the_grid_without_moving_its_points():
    made = grid(speed=(0.2, 0.75), road=(0.5, 1.0), gap=(12, 20))
    assert {tuple(made.values(n).values())[:2] for n in range(made.size)} == {(0.4, 0.75), (0.7, 0.75)}
    assert {made.values(n)["gap"] for n in range(made.size)} == {12, 14, 16, 18, 20}


def test_an_odd_that_leaves_no_value_is_refused():
    with pytest.raises(ConfigError, match="speed"):
        grid(speed=(0.2, 0.3))


def test_numbers_and_levels_are_inverse():
    made = grid()
    assert [made.number(made.levels(number)) for number in range(made.size)] == list(range(made.size))
    with pytest.raises(IndexError):
        made.levels(made.size)
