"""The list of fields and rows in README.md is that of the code, and holds in a real episode."""

import re
from contextlib import closing

import numpy as np
import pytest

from risk_sac import types
from risk_sac.config import EgoConfig, RunSpec
from risk_sac.egos import pilot
from risk_sac.egos.seam import Perceived
from risk_sac.env import RiskSacEnv
from risk_sac.sim import paths
from tests.server import ROOT

README = (ROOT / "risk_sac" / "egos" / "README.md").read_text(encoding="utf-8")


def rows(head: str) -> list[tuple[str, ...]]:
    """Lines below a head of the block: numbers and names, and what is said of them."""
    block = README.split("```\nPerceived\n")[1].split("```")[0]
    (below,) = (part for part in f"Perceived\n{block}".split("\n\n") if part.startswith(head))
    return [tuple(re.split(r" {2,}", line.strip())) for line in below.splitlines()[1:]]


@pytest.fixture(scope="module")
def perceived() -> list[Perceived]:
    """Frames of an episode with a pedestrian."""
    seen: list[Perceived] = []
    real = pilot.perceive

    def recorded(*arguments: object) -> Perceived:
        seen.append(real(*arguments))  # type: ignore[arg-type]
        return seen[-1]

    spec = RunSpec(family="mixed", method="no-adversary", seed=0, ego=EgoConfig(driver="idm-aeb"))
    with pytest.MonkeyPatch.context() as patch, closing(RiskSacEnv.of(spec)) as env:
        patch.setattr(pilot, "perceive", recorded)
        for seed in range(20):
            env.reset(seed=seed)
            for _ in range(10):
                env.step(np.zeros(env.action_size))
            if any(len(each.ids) > 1 for each in seen):
                return seen
    raise AssertionError("no other actor was perceived in 20 episodes")


@pytest.mark.parametrize(("module", "name"), [(types, "state"), (paths, "path")])
def test_rows_are_those_of_the_code(module: object, name: str, perceived: list[Perceived]) -> None:
    told = rows(f"Rows of {name}, named in {module.__name__}\n")  # type: ignore[attr-defined]
    assert [(int(index), getattr(module, row)) for index, row, *_ in told] == [(i, i) for i in range(len(told))]
    (shape,) = (said for field, said in rows("Perceived") if field == name)
    assert int(shape.partition(" x ")[0]) == len(told)
    assert {getattr(frame, name).shape[0] for frame in perceived} == {len(told)}


def test_what_is_missing_of_others_is_nan_and_nothing_else_is(perceived: list[Perceived]) -> None:
    missing = [int(index) for index, _, *said in rows("Rows of state") if "NaN of others" in " ".join(said)]
    assert missing
    for frame in perceived:
        unknown = np.isnan(frame.state)
        assert not unknown[:, 0].any()
        assert unknown[missing, 1:].all()
        assert not np.delete(unknown, missing, axis=0).any()
        assert frame.state.shape[1] == len(frame.ids) == len(frame.kind)
        assert frame.state[types.OFFSET, 0] == frame.offset_m
        assert np.allclose(frame.path[paths.COS], np.cos(frame.path[paths.HEADING]))
        assert not np.isnan(frame.path).any()
