from pathlib import Path

import numpy as np

from risk_sac.config import RunSpec
from risk_sac.env.problem import Problem
from risk_sac.lab.figures.side_by_side import Row, rows_of
from risk_sac.lab.figures.table_one import lines, uniform_ecr
from risk_sac.search.frozen_policy import FrozenPolicy


def row(method: str, seed: int, ecr: float, dispersion: float | None) -> Row:
    """Figures of a run: those of Table I and those beside them."""
    others = {"uniform_ecr": 0.1, "efficiency": 0.5, "cost_rate": 0.2, "pcr": 0.0, "distinct": 3}
    windows = {"ecr_100": 0.2, "ecr_200": 0.4, "ecr_300": 0.6}
    figures = {"ecr": ecr, "dispersion": dispersion}
    return {"family": "mixed", "method": method, "seed": seed} | figures | others | windows


def test_a_method_has_its_mean_over_the_seeds_beside_the_paper() -> None:
    rows = [row("sac", 1, 0.5, None), row("sac", 2, 0.7, 0.4), row("ddpg", 1, 0.3, None)]
    table = [line.split(" | ") for line in lines(rows)][2:]
    assert [cells[1:7] for cells in table] == [
        ["`sac`", "2", "0.65", "0.50 ± 0.00", "0.60 ± 0.14", "0.10 ± 0.00"],
        ["`ddpg`", "1", "–", "0.50", "0.30", "0.10"],
    ]
    assert [cells[9] for cells in table] == ["0.40", "–"]  # dispersion, of the seeds that have one


def test_a_frozen_policy_meets_playable_scenes() -> None:
    spec = RunSpec(family="low", method="sac", seed=1)
    problem = Problem.from_spec(spec)
    size = problem.action_size
    idle = FrozenPolicy((np.zeros((problem.observation_size, size), np.float32), np.zeros(size, np.float32)), size)
    assert uniform_ecr(spec, idle, 2) == 0.0  # all actions 0 hardly ever lead to a contact


def test_runs_keep_their_order(tmp_path: Path) -> None:
    file = tmp_path / "made" / "rows.csv"
    rows = rows_of(dict, [[("seed", 2)], [("seed", 1)]], 2, file)
    assert rows == [{"seed": 2}, {"seed": 1}]
    assert file.read_text() == "seed\n2\n1\n"
