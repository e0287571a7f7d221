"""Every number of a campaign has bounds, and runs there stay finite."""

import functools
import itertools
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
import torch
from pydantic import ValidationError

from risk_sac.config import METHODS, CampaignSpec, Odd, RunSpec
from risk_sac.config.base import field_error
from risk_sac.env.problem import Problem
from risk_sac.errors import OddError
from risk_sac.records import EpisodeRecord, RunMetrics
from risk_sac.run_folder.arrays import read_series
from risk_sac.run_folder.crash_guard import CrashGuard
from risk_sac.scenario.odd import SENSIBLE
from risk_sac.search.loop import episode
from risk_sac.search.playing import GuardedEnv
from risk_sac.search.run import RunState

SMALL = {  # what costs time or memory, and is bounded for that
    "seeds": [5],
    "budget.episodes": 3,
    "budget.evaluation_episodes": 0,
    "learner.agent.hidden_sizes": [8, 8],
    "learner.agent.batch_size": 8,
    "learner.agent.updates_per_step": 1,
    "learner.agent.warmup_steps": 20,
    "learner.warm_start.episodes": 1,
    "learner.agent.device": "cpu",
    "learner.replay.capacity": 1000,
    "learner.scenes.initial_scenes": 2,
    "learner.scenes.window": 8,
    "learner.scenes.candidates": 16,
    "learner.scenes.refit_every": 1,
}
REQUIREMENT = {"name": "mine", "formula": "encounter_s >= 0 and ego_speed_mps * 1000000 >= 0"}


class Number(NamedTuple):
    """A number of the campaign's schema, as it is published."""

    path: str  # "learner.agent.discount"
    type: str  # number | integer
    low: float | None
    high: float | None


def numbers(node: dict[str, Any], path: str = "") -> Iterator[Number]:
    """Yields every number below a schema node; list entries by list name."""
    node = next((option for option in node.get("anyOf", []) if option.get("type") != "null"), node)
    if "$ref" in node:
        node = schema()["$defs"][node["$ref"].rpartition("/")[2]]
    if node.get("type") in ("number", "integer"):
        yield Number(path, node["type"], node.get("minimum"), node.get("maximum"))
    for name, part in node.get("properties", {}).items():
        yield from numbers(part, f"{path}.{name}".removeprefix("."))
    if "items" in node:
        yield from numbers(node["items"], path)


@functools.cache
def schema() -> dict[str, Any]:
    return CampaignSpec.model_json_schema()


OF_ODD = {f"odd.{path}.{end}" for path in SENSIBLE for end in ("low", "high")}  # bounded there, one by one
BOUNDED = [number for number in numbers(schema()) if number.path not in OF_ODD]
EQUIPMENT = "ego.sensors.", "ego.actuators."  # of registered egos
# The budget of processor time apart: at its low end a run is over before it has learnt, sooner on a slower machine.
FLOATS = [
    number
    for number in BOUNDED
    if number.type == "number" and number.path != "budget.cpu_s" and not number.path.startswith(EQUIPMENT)
]
CORNERS = 12
IN_TIME = (0, 4, 8)  # two of SAC and one of DDPG; the others in `make torture`
LEARNING = [name for name, method in METHODS.items() if method.learns]


def test_every_number_of_a_campaign_has_bounds() -> None:
    assert len(FLOATS) > 25
    assert {number.path for number in numbers(schema()) if number.path.startswith("odd.")} == OF_ODD
    for number in BOUNDED:
        assert number.low is not None, number.path
        assert number.high is not None, number.path


@pytest.mark.parametrize("number", BOUNDED, ids=lambda number: number.path)
def test_a_number_beyond_its_bounds_is_refused_by_name(number: Number) -> None:
    for value in (number.low - 1, number.high * 2 + 1):
        with pytest.raises(ValidationError) as refusal:
            campaign({number.path: [value] if number.path in ("seeds", "learner.agent.hidden_sizes") else value})
        fields = {re.sub(r"\[\d+\]", "", field_error(error).field) for error in refusal.value.errors()}
        assert number.path in fields


def campaign(changes: dict[str, Any], family: str = "low", method: str = "risk-sac") -> CampaignSpec:
    data: dict[str, Any] = {"families": [family], "methods": [method], "requirements": [REQUIREMENT | {"scale": 1.0}]}
    for path, value in {**SMALL, **changes}.items():
        *branches, name = path.split(".")
        place = data
        for branch in branches:
            place = place["requirements"][0] if branch == "requirements" else place.setdefault(branch, {})
        place[name] = value
    return CampaignSpec.model_validate(data)


def play(spec: RunSpec, folder: Path) -> None:
    """Plays a run, and checks that it stores and learns finite numbers."""
    torch.set_num_threads(1)
    folder.mkdir()
    run = RunState(spec, folder)
    try:
        with CrashGuard(folder) as guard:
            env = GuardedEnv(run.env, guard)
            while not run.finished:
                metrics = episode(run, env)
                assert_told_in_full(run.latest[-1], metrics)
        for contact in run.series.values():
            series = read_series(folder / "failures" / contact.name)
            assert all(np.isfinite(series[name]).all() for name in ("robustness", "soft_min", "least_ttc_s"))
        assert_finite(run.searchers.agent.state())
    finally:
        run.close()


def assert_told_in_full(record: EpisodeRecord, metrics: RunMetrics) -> None:
    for text in (record.model_dump_json(), metrics.model_dump_json()):
        assert "NaN" not in text, text
        assert "Infinity" not in text, text


def assert_finite(state: Any) -> None:
    if isinstance(state, dict):
        for value in state.values():
            assert_finite(value)
    elif isinstance(state, list | tuple):
        for value in state:
            assert_finite(value)
    elif isinstance(state, torch.Tensor) and state.is_floating_point():
        assert torch.isfinite(state).all()
    elif isinstance(state, float):
        assert np.isfinite(state)


@pytest.mark.parametrize(
    "corner",
    [corner if corner in IN_TIME else pytest.param(corner, marks=pytest.mark.torture) for corner in range(CORNERS)],
)
def test_a_run_with_floats_at_their_bounds_stays_finite(corner: int, tmp_path: Path) -> None:
    """Over all corners, low end, high end and default are equally frequent."""
    ends = {}
    for number in FLOATS:
        place = np.random.default_rng(list(number.path.encode())).permutation(CORNERS)[corner] % 3
        if place < 2:
            ends[number.path] = float((number.low, number.high)[place])
    method = LEARNING[corner % len(LEARNING)]
    families = ("low", "mixed") if METHODS[method].prior == "policy" else ("low", "mixed", "dense")  # dense ships none
    play(campaign(ends, families[corner % len(families)], method).runs()[0], tmp_path / "run")


@pytest.mark.parametrize("end", ["low", "high"])
def test_a_run_with_equipment_at_its_bounds_stays_finite(end: str, tmp_path: Path) -> None:
    ends = {number.path: getattr(number, end) for number in BOUNDED if number.path.startswith(EQUIPMENT)}
    assert len(ends) > 20
    play(campaign({"ego.driver": "idm-aeb", **ends}, "mixed", "random").runs()[0], tmp_path / "run")


def odds() -> Iterator[tuple[str, float, float]]:
    """Yields narrow and wide intervals at sensible ends and about 0."""
    for path, sensible in SENSIBLE.items():
        ends = (sensible.low, -5e-324, 0.0, 5e-324, sensible.high)
        yield from ((path, low, high) for low, high in itertools.combinations_with_replacement(sorted(ends), 2))


def test_an_odd_at_the_ends_of_what_is_sensible_is_refused_or_leaves_a_run_finite(tmp_path: Path) -> None:
    played = 0
    for number, (path, low, high) in enumerate(dict.fromkeys(odds())):
        branch, name = path.split(".")
        odd = Odd.model_validate({branch: {name: {"low": low, "high": high}}})
        for family in ("low", "mixed"):
            spec = campaign({"budget.episodes": 1}, family, "random").runs()[0].model_copy(update={"odd": odd})
            try:
                Problem.from_spec(spec)
            except OddError:
                continue
            played += 1
            play(spec, tmp_path / f"{number}-{family}")
    assert played > 20
