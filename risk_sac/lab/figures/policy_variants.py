"""Trains and compares variants of the pretrained policy.

    python -m risk_sac.lab.figures.policy_variants OUT [--variants shipped kinds ...] [--scenario low] [--episodes 1500]
      [--seed 21] [--jobs 2]

trains each as the first stage of `risk-sac pretrain` does, and plays it frozen in random scenes before EGOS. `one kind`
is asked for one kind only: that which `kinds` reaches most often. It goes on with what OUT lacks, and rewrites
OUT/table.md after each variant.
"""

import argparse
import json
import multiprocessing
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import Executor, ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from risk_sac.lab.figures.pretrained_policy import EPISODES, episodes
from risk_sac.lab.pretraining.policy import AGENT, STAGES, Goals, PolicyTraining
from risk_sac.lab.pretraining.rollouts import PolicyEpisode
from risk_sac.scenario.reading import PAPER_FAMILIES
from risk_sac.search.agents.transition import Transition

EGOS = ("fiss-plus", "idm-aeb+slow-replanning", "default")
COLUMNS = (
    "variant",
    "ego",
    "failures",
    "distinct",
    "candidates, distinct",
    "kinds asked for reached",
    "most of one kind",
)
HEAD = f"| {' | '.join(COLUMNS)} |\n|{len(COLUMNS) * '---|'}"


class PolicyVariant(NamedTuple):
    """Differences from the shipped policy."""

    kinds: bool = False
    discount: float = AGENT.discount  # of a decision
    decisions: int = 1  # n of n-step returns


VARIANTS = {
    "shipped": PolicyVariant(),
    "kinds": PolicyVariant(kinds=True),
    "one kind": PolicyVariant(kinds=True),
    "γ of 0.9": PolicyVariant(discount=0.9),
    "γ of 0.98": PolicyVariant(discount=0.98),
    "3-step returns": PolicyVariant(decisions=3),
}


class OneKind(Goals):
    """Goals of a policy that is asked for one kind of failure only."""

    def __init__(self, name: str) -> None:
        super().__init__(asked=True, names=[name])

    def add(self, name: str) -> int:
        """See `Goals.add`."""
        return super().add(name) if name in self.names else 0

    def draw(self, random: np.random.Generator) -> int:
        """See `Goals.draw`."""
        return 1


def summed(decisions: Sequence[Transition], count: int, discount: float) -> list[Transition]:
    """Returns transitions over `count` decisions each.

    Those that a time limit cuts short are left out, because the discount of their next state would be another.
    """
    transitions = []
    for i, first in enumerate(decisions):
        part = decisions[i : i + count]
        if len(part) == count or part[-1].terminated:
            reward = sum(discount**k * each.risk_reward for k, each in enumerate(part))
            last = part[-1]
            transitions.append(
                replace(
                    first,
                    risk_reward=reward,
                    next_observation=last.next_observation,
                    terminated=last.terminated,
                )
            )
    return transitions


class VariantTraining(PolicyTraining):
    """First stage of the training of a variant."""

    def __init__(self, variant: PolicyVariant, goals: Goals, options: argparse.Namespace) -> None:
        agent = AGENT.model_copy(update={"discount": variant.discount**variant.decisions})
        stages = STAGES[:1]
        super().__init__(
            options.family, options.seed, options.episodes, kinds=variant.kinds, agent=agent, stages=stages
        )
        self.goals = goals
        self._variant = variant

    def learn(self, episodes: list[PolicyEpisode]) -> None:
        """See `PolicyTraining.learn`."""
        count, discount = self._variant.decisions, self._variant.discount
        super().learn([replace(each, decisions=summed(each.decisions, count, discount)) for each in episodes])


def row(label: str, ego: str, played: Sequence[PolicyEpisode], names: Sequence[str]) -> dict[str, Any]:
    """Returns what a frozen policy found before an ego."""
    failed = [each for each in played if each.kind]
    goals = Counter(each.goal for each in failed)
    return {
        "variant": label,
        "ego": ego,
        "failures": f"{len(failed)} of {len(played)}",
        "distinct": len({each.kind for each in failed}),
        "candidates": len({each.kind for each in failed if each.candidate}),
        "reached": sum(each.asked > 0 and each.goal == names[each.asked - 1] for each in failed),
        "goals": dict(goals.most_common()),
    }


def rows_of(label: str, goals: Goals, options: argparse.Namespace, pool: Executor) -> list[dict[str, Any]]:
    """Trains a variant unless OUT has its rows; returns them."""
    folder = options.out / label.replace(" ", "-")
    file = folder / "rows.json"
    if not file.exists():
        folder.mkdir(parents=True, exist_ok=True)
        training = VariantTraining(VARIANTS[label], goals, options)
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
    parser.add_argument("--variants", nargs="+", choices=VARIANTS, default=list(VARIANTS), metavar="NAME")
    parser.add_argument("--scenario", dest="family", choices=PAPER_FAMILIES, default="low")
    parser.add_argument("--episodes", type=int, default=1500)
    parser.add_argument("--scenes", type=int, default=6 * EPISODES)
    parser.add_argument("--seed", type=int, default=21)
    parser.add_argument("--jobs", type=int, default=2)
    options = parser.parse_args()
    rows: list[dict[str, Any]] = []
    with ProcessPoolExecutor(options.jobs, multiprocessing.get_context("spawn")) as pool:
        for label in options.variants:
            goals = Goals(asked=VARIANTS[label].kinds)
            if label == "one kind":
                reached = rows_of("kinds", Goals(asked=True), options, pool)
                goals = OneKind(sum((Counter(each["goals"]) for each in reached), Counter[str]()).most_common(1)[0][0])
            rows += rows_of(label, goals, options, pool)
            text = [
                f"| {counts['variant']} | `{counts['ego']}` | {counts['failures']} | {counts['distinct']} |"
                f" {counts['candidates']} | {counts['reached']} | {max(counts['goals'].values(), default=0)} |"
                for counts in rows
            ]
            (options.out / "table.md").write_text("\n".join([HEAD, *text]) + "\n")
    print((options.out / "table.md").read_text())


if __name__ == "__main__":
    main()
