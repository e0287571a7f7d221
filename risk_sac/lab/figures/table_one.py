"""Measures Table I of the paper, while methods search and frozen.

    python -m risk_sac.lab.figures.table_one OUT [--scenario NAME …] [--seeds N] [--episodes N] [--uniform N] [--jobs N]

plays what OUT lacks, seeds outermost, and rewrites OUT/runs.csv after each run; at the end it writes OUT/table.md and
OUT/curves.svg. A frozen policy is played in scenes of its method's own sampler and in uniformly drawn ones, which are
the same for all methods.
"""

import argparse
import json
from collections.abc import Iterator, Sequence
from contextlib import closing
from functools import partial
from itertools import product
from pathlib import Path
from statistics import mean, stdev

import numpy as np
from matplotlib.figure import Figure

from risk_sac.config import Budget, MethodName, RunSpec
from risk_sac.env.env import RiskSacEnv
from risk_sac.errors import EgoFailed, InfeasibleScene
from risk_sac.execution.evaluate import run
from risk_sac.failures.from_above import canvas, picture
from risk_sac.failures.study import policy_of
from risk_sac.lab.figures.side_by_side import Row, rows_of
from risk_sac.report.drawing import STYLE, look_of
from risk_sac.run_folder.results import EPISODES, RESULTS, read_results, records_from_lines
from risk_sac.scenario.reading import PAPER_FAMILIES
from risk_sac.search.agents.controls import Held
from risk_sac.search.frozen_policy import FrozenPolicy

METHODS: Sequence[MethodName] = (
    "risk-sac",
    "risk-sac-only-rper",
    "risk-sac-only-rs",
    "sac-lag",
    "sac",
    "ddpg-lag",
    "ddpg",
)
FIRST_SEED = 701
OWN = 100  # episodes of the frozen policy in its method's own scenes
WINDOW = 100  # episodes
UNIFORM_SEED = 7  # of the uniformly drawn scenes
# ECR of the paper's Table I in low, mixed and dense; it has no DDPG.
PAPER = {
    "risk-sac": (0.97, 0.92, 0.89),
    "risk-sac-only-rper": (0.92, 0.88, 0.85),
    "risk-sac-only-rs": (0.89, 0.84, 0.81),
    "sac-lag": (0.81, 0.70, 0.63),
    "sac": (0.74, 0.65, 0.55),
}


def play(out: Path, episodes: int, uniform: int, spec: RunSpec) -> Row:
    """Plays a run unless OUT has it; returns its figures."""
    folder = out / spec.id
    file = folder / f"row-{episodes}-{uniform}.json"
    if file.exists():
        known: Row = json.loads(file.read_text())
        return known
    done = (folder / RESULTS).exists() and read_results(folder).finished
    results = read_results(folder) if done else run(spec, folder, lambda episodes, metrics: None)
    frozen, policy = results.evaluation, policy_of(folder, results)
    assert frozen is not None  # because of the budget
    assert policy is not None  # because each method learns
    searched = [each for each in records_from_lines((folder / EPISODES).read_bytes()) if not each.evaluating]
    valid = [each.collision is not None and each.collision.valid for each in searched]
    windows = [mean(valid[at : at + WINDOW]) for at in range(0, episodes, WINDOW)]
    row = {
        "family": spec.family,
        "method": spec.method,
        "seed": spec.seed,
        "ecr": frozen.ecr,
        "efficiency": frozen.efficiency,
        "cost_rate": frozen.cost_rate,
        "dispersion": frozen.dispersion,
        "pcr": frozen.pcr,
        "distinct": frozen.distinct_failures,
        "uniform_ecr": uniform_ecr(spec, policy, uniform),
        "steps": searched[-1].environment_steps,
        **{
            f"ecr_{at}": round(share, 2) for at, share in zip(range(WINDOW, episodes + 1, WINDOW), windows, strict=True)
        },
    }
    file.write_text(json.dumps(row) + "\n")
    return row


def uniform_ecr(spec: RunSpec, policy: FrozenPolicy, episodes: int) -> float:
    """Returns the valid contacts per uniformly drawn scene; scenes that cannot be played are drawn again."""
    random, found, played = np.random.default_rng(UNIFORM_SEED), 0, 0
    with closing(RiskSacEnv.of(spec)) as env:
        while played < episodes:
            scene = env.problem.space.from_unit(random.random(env.problem.space.dimension))
            held, ended = Held(spec.learner.agent.decision_steps), False
            try:
                observation, info = env.reset(seed=int(random.integers(1 << 30)), options={"scene": scene})
                while not ended:
                    observation, _, terminated, truncated, info = env.step(held.act(partial(policy, observation)))
                    ended = terminated or truncated
            except (InfeasibleScene, EgoFailed):
                continue
            played += 1
            hit = info.get("collision")
            found += hit is not None and hit.valid
    return found / episodes


def lines(rows: Sequence[Row]) -> Iterator[str]:
    """Yields a row per family and method: mean and standard deviation over the seeds."""
    names = ("ecr", "uniform_ecr", "efficiency", "cost_rate", "dispersion", "pcr", "distinct")
    last = [name for name in rows[0] if name.startswith("ecr_")][-2:]
    yield f"| family | method | seeds | ECR in the paper | ECR of the last 200 | {' | '.join(names)} |"
    yield "|---" * (5 + len(names)) + "|"
    for family, method in product(PAPER_FAMILIES, METHODS):
        of = [row for row in rows if (row["family"], row["method"]) == (family, method)]
        if not of:
            continue
        paper = f"{PAPER[method][PAPER_FAMILIES.index(family)]:.2f}" if method in PAPER else "–"
        cells = [_cell([mean(row[name] for name in last) for row in of])]
        cells += [_cell([row[name] for row in of]) for name in names]
        yield f"| {family} | `{method}` | {len(of)} | {paper} | {' | '.join(cells)} |"


def curves(rows: Sequence[Row]) -> Figure:
    """Draws the ECR of each window of the search: mean over the seeds, a panel per family."""
    figure = canvas((9.0, 3.2))
    panels = figure.subplots(1, len(PAPER_FAMILIES), sharey=True)
    names = [name for name in rows[0] if name.startswith("ecr_")]
    for axes, family in zip(panels, PAPER_FAMILIES, strict=True):
        axes.set(title=family, xlabel="search episode", ylim=(0.0, 1.0))
        for method in METHODS:
            of = [row for row in rows if (row["family"], row["method"]) == (family, method)]
            if of:
                shares = [mean(row[name] for row in of) for name in names]
                axes.plot([WINDOW * (1 + k) for k in range(len(names))], shares, label=method, **look_of(method).line)
    panels[0].set_ylabel(f"ECR of {WINDOW} episodes")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=len(METHODS))
    return figure


def _cell(values: Sequence[float | None]) -> str:
    known = [value for value in values if value is not None]
    if not known:
        return "–"
    return f"{mean(known):.2f}" + (f" ± {stdev(known):.2f}" if len(known) > 1 else "")


def main() -> None:
    """Plays what is missing."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--scenario", dest="families", nargs="+", choices=PAPER_FAMILIES, default=list(PAPER_FAMILIES))
    parser.add_argument("--methods", nargs="+", choices=METHODS, default=list(METHODS))
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--first-seed", type=int, default=FIRST_SEED)
    parser.add_argument("--episodes", type=int, default=1000)
    parser.add_argument("--uniform", type=int, default=100, help="uniformly drawn scenes (default: %(default)s)")
    parser.add_argument("--jobs", type=int, default=2)
    options = parser.parse_args()
    budget = Budget(episodes=options.episodes, evaluation_episodes=OWN)
    seeds = range(options.first_seed, options.first_seed + options.seeds)
    runs = [
        RunSpec(family=family, method=method, seed=seed, budget=budget)
        for seed, family, method in product(seeds, options.families, options.methods)
    ]
    rows = rows_of(
        partial(play, options.out, options.episodes, options.uniform), runs, options.jobs, options.out / "runs.csv"
    )
    text = "\n".join(lines(rows))
    (options.out / "table.md").write_text(text + "\n")
    (drawn,) = picture(partial(curves, rows), ["svg"], 200, STYLE)
    (options.out / "curves.svg").write_bytes(drawn)
    print(text)


if __name__ == "__main__":
    main()
