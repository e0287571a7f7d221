"""Policies that are asked for kinds of failures, beside one that is not and one per kind.

    python -m tests.acceptance.goal_variants OUT [--family low] [--episodes 1500] [--seed 21] [--kinds 2] [--jobs 2]

trains each as the first stage of `risk-sac pretrain` does, and plays it frozen in random scenes before EGOS. `one` is
asked for one kind only: each of the N commonest kinds of `kinds` in turn. It goes on with what OUT lacks, and rewrites
OUT/table.md after each policy.
"""

import argparse
import json
import multiprocessing
import re
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import Executor, ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

from risk_sac.config import SHIPPED
from risk_sac.pretraining.policy import STAGES, Goals, PolicyTraining
from risk_sac.pretraining.rollouts import PolicyEpisode
from tests.acceptance.pretrained_policy import EPISODES, episodes

EGOS = ("fiss-plus", "idm-aeb+slow-replanning", "default")
COLUMNS = "policy", "ego", "failures", "distinct", "candidates, distinct", "kinds asked for reached", "most of one kind"
HEAD = f"| {' | '.join(COLUMNS)} |\n|{len(COLUMNS) * '---|'}"


class OneKind(Goals):
    """Goals of a policy that is asked for one kind only; a failure of another one is any failure."""

    def __init__(self, name: str) -> None:
        super().__init__(asked=True, names=[name])

    def add(self, name: str) -> int:
        """See `Goals.add`."""
        return super().add(name) if name in self.names else 0

    def draw(self, random: np.random.Generator) -> int:
        """See `Goals.draw`."""
        return 1


def row(label: str, ego: str, played: Sequence[PolicyEpisode], names: Sequence[str]) -> dict[str, Any]:
    """Returns what a frozen policy found before an ego."""
    failed = [each for each in played if each.kind]
    goals = Counter(each.goal for each in failed)
    return {
        "policy": label,
        "ego": ego,
        "failures": f"{len(failed)} of {len(played)}",
        "distinct": len({each.kind for each in failed}),
        "candidates": len({each.kind for each in failed if each.candidate}),
        "reached": sum(each.asked > 0 and each.goal == names[each.asked - 1] for each in failed),
        "goals": dict(goals.most_common()),
    }


def variant(label: str, goals: Goals, options: argparse.Namespace, pool: Executor) -> list[dict[str, Any]]:
    """Trains a policy unless OUT has its rows; returns them."""
    folder = options.out / re.sub(r"\W+", "-", label)
    file = folder / "rows.json"
    if not file.exists():
        folder.mkdir(parents=True, exist_ok=True)
        training = PolicyTraining(options.family, options.seed, options.episodes, stages=STAGES[:1])
        training.goals = goals
        for point in training.run(pool, folder):
            print(label, point, flush=True)
        layers, names = list(training.agent.frozen().layers), training.goals.names
        drawn = np.random.default_rng(options.seed)
        asked = [goals.draw(drawn) for _ in range(options.scenes)]
        rows = [row(label, ego, list(episodes(ego, layers, asked, options)), names) for ego in EGOS]
        file.write_text(json.dumps(rows, indent=1) + "\n")
    found: list[dict[str, Any]] = json.loads(file.read_text())
    return found


def main() -> None:
    """Trains and plays what is missing."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--family", choices=SHIPPED, default="low")
    parser.add_argument("--episodes", type=int, default=1500)
    parser.add_argument("--scenes", type=int, default=6 * EPISODES)
    parser.add_argument("--seed", type=int, default=21)
    parser.add_argument("--kinds", type=int, default=2)
    parser.add_argument("--jobs", type=int, default=2)
    options = parser.parse_args()
    with ProcessPoolExecutor(options.jobs, multiprocessing.get_context("spawn")) as pool:
        rows = variant("kinds", Goals(asked=True), options, pool)
        goals = sum((Counter(each["goals"]) for each in rows), Counter[str]())
        rows += variant("any", Goals(), options, pool)
        for name, _ in goals.most_common(options.kinds):
            rows += variant(f"one: {name}", OneKind(name), options, pool)
            text = [
                f"| {each['policy']} | `{each['ego']}` | {each['failures']} | {each['distinct']} | {each['candidates']} |"
                f" {each['reached']} | {max(each['goals'].values(), default=0)} |"
                for each in rows
            ]
            (options.out / "table.md").write_text("\n".join([HEAD, *text]) + "\n")
    print((options.out / "table.md").read_text())


if __name__ == "__main__":
    main()
