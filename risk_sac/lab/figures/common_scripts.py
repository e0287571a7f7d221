"""Compares egos by the failures that the same scenes and scripts bring about.

    python -m risk_sac.lab.figures.common_scripts OUT [--scenario NAME ...] [--episodes N] [--seed N]

plays what OUT lacks, one file for each family and ego, and prints each ego's rate of plausible, preventable failures.
Half of the points are uniform; the others take a row of the shipped library, moved by a normal deviation of 0.05. The
test for a trend over the egos, from the worst to the best, is that of Cochran and Armitage, one-sided.
"""

import argparse
import csv
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path

import numpy as np
from scipy.stats import norm

from risk_sac.config import EgoConfig, RunSpec
from risk_sac.env.env import RiskSacEnv
from risk_sac.errors import EgoFailed, InfeasibleScene
from risk_sac.lab.pretraining.episodes import play
from risk_sac.run_folder.durable import replace_file
from risk_sac.search.agents.controls import ScriptFollower
from risk_sac.search.prior.shipped import shipped_library
from risk_sac.world.types import Floats

EGOS = {
    "broken": EgoConfig(driver="broken"),
    "reaction-1.0": EgoConfig(reaction_time_s=1.0),
    "default": EgoConfig(),
    "idm-aeb": EgoConfig(driver="idm-aeb"),
    "r157": EgoConfig(driver="r157"),
    "defensive": EgoConfig(profile="defensive"),  # apart: it is judged by its own rules
}
ORDERED = ("broken", "reaction-1.0", "default", "idm-aeb", "r157")
COLUMNS = ("valid", "preventable", "serious", "plausible_preventable", "headline_candidate")
DEVIATION = 0.05


def points(family: str, size: int, episodes: int, seed: int) -> Floats:
    """Returns the points that all egos meet, `episodes x size`, in the unit cube."""
    random = np.random.default_rng(seed)
    drawn = random.random((episodes, size))
    library = shipped_library(family).points
    rows = library[random.integers(len(library), size=episodes)]
    moved = np.clip(rows + random.normal(0.0, DEVIATION, rows.shape), 0.0, 1.0)
    drawn[::2] = moved[::2]
    return drawn


def outcomes(family: str, ego: EgoConfig, episodes: int, seed: int) -> list[tuple[int, ...]]:
    """Plays the points before an ego; returns a row of `COLUMNS` for each that could be played."""
    with closing(RiskSacEnv.of(RunSpec(family=family, method="archive", seed=seed, ego=ego))) as env:
        problem, follower = env.problem, ScriptFollower(env.problem.family)
        dimension, rows = problem.space.dimension, list[tuple[int, ...]]()
        for index, point in enumerate(points(family, dimension + follower.genes, episodes, seed)):
            scene, genes = problem.space.from_unit(point[:dimension]), point[dimension:]
            try:
                met, _ = play(env, follower, scene, genes, seed * episodes + index, problem.family.horizon_steps)
            except (InfeasibleScene, EgoFailed):
                continue
            worst = met.valid_violations
            flags = (
                bool(worst),
                any(violation.preventable for violation in worst),
                any(violation.serious for violation in worst),
                any(violation.preventable and violation.plausible for violation in worst),
                any(violation.headline_candidate for violation in worst),
            )
            rows.append((index, *map(int, flags)))
    return rows


def trend(failures: Sequence[int], episodes: Sequence[int]) -> float:
    """Returns the one-sided p of Cochran and Armitage that rates fall in this order."""
    scores, sizes, hits = np.arange(len(failures), 0.0, -1.0), np.asarray(episodes), np.asarray(failures)
    rate = hits.sum() / sizes.sum()
    centred = scores - (scores * sizes).sum() / sizes.sum()
    spread = rate * (1.0 - rate) * (centred**2 * sizes).sum()
    return float(norm.sf((centred * hits).sum() / np.sqrt(spread))) if spread > 0.0 else 1.0


def main() -> None:
    """Plays, writes and prints."""
    parser = argparse.ArgumentParser(prog="python -m risk_sac.lab.figures.common_scripts", description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--scenario", dest="families", nargs="+", default=["low", "mixed", "dense"])
    parser.add_argument("--episodes", type=int, default=500)
    parser.add_argument("--seed", type=int, default=961)
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    for family in options.families:
        counts = {}
        for name, ego in EGOS.items():
            file = options.out / f"{family}-{name}-{options.seed}-{options.episodes}.csv"
            if not file.exists():
                rows = outcomes(family, ego, options.episodes, options.seed)
                text = "\n".join(",".join(map(str, row)) for row in [("index", *COLUMNS), *rows])
                replace_file(file, f"{text}\n".encode())
            with file.open() as lines:
                played = [[int(row[column]) for column in COLUMNS] for row in csv.DictReader(lines)]
            counts[name] = len(played), *map(sum, zip(*played, strict=True))
            print(family, name, counts[name][0], dict(zip(COLUMNS, counts[name][1:], strict=True)), flush=True)
        sizes = [counts[name][0] for name in ORDERED]
        for column in ("plausible_preventable", "headline_candidate"):
            place = COLUMNS.index(column) + 1
            p = trend([counts[name][place] for name in ORDERED], sizes)
            print(f"{family}: {column} falls from {ORDERED[0]} to {ORDERED[-1]}: p = {p:.2g}", flush=True)


if __name__ == "__main__":
    main()
