"""Measures all shipped scenarios: contacts without an attack, and what each method finds.

    python -m risk_sac.lab.figures.shipped_scenarios OUT undisturbed [--egos EGO ...] [--scenes N]
    python -m risk_sac.lab.figures.shipped_scenarios OUT searches [--egos EGO ...] [--methods NAME ...] [--seeds N]
        [--steps N]

Both play what OUT lacks and rewrite OUT/undisturbed.csv or OUT/searches.csv after each cell, so that a part is a
table, too. A search ends after its episodes or its environment steps. An ego is `default`, a driver, or a driver and a
defect such as `idm-aeb+latency`. Where searches find nothing, `uniform_scenes --drivers any` tells what scripts can
reach.
"""

import argparse
import json
import math
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import closing
from functools import partial
from itertools import product
from pathlib import Path
from typing import NamedTuple

import numpy as np

from risk_sac.config import Budget, MethodName, RunSpec
from risk_sac.egos.registry import pinned
from risk_sac.env.env import RiskSacEnv
from risk_sac.errors import InfeasibleScene
from risk_sac.execution.evaluate import verify
from risk_sac.execution.recorder import Recorder
from risk_sac.lab.figures.pretrained_policy import ego_of
from risk_sac.lab.figures.regression_prior import Until
from risk_sac.lab.figures.side_by_side import Row, rows_of
from risk_sac.records import EpisodeRecord, PlausibilityClass
from risk_sac.run_folder.durable import replace_file
from risk_sac.run_folder.results import EPISODES, RESULTS, read_results, records_from_lines
from risk_sac.scenario.reading import PAPER_FAMILIES, shipped_names
from risk_sac.search.loop import execute_run

METHODS: Sequence[MethodName] = ("archive", "random", "risk-sac-diverse", "risk-sac")
NEWEST_FIRST = (*(name for name in shipped_names() if name not in PAPER_FAMILIES), *PAPER_FAMILIES)
EGOS = {"undisturbed": ["default", "idm-aeb"], "searches": ["idm-aeb"]}
FIRST_SEED = 1
UNDISTURBED_SEED = 58


class Cell(NamedTuple):
    """Key of a row; `method` is empty and `seed` fixed without an attack."""

    scenario: str
    ego: str
    method: str
    seed: int


def kept(file: Path, row: Row) -> Row:
    """Writes a row to its file and returns it."""
    file.parent.mkdir(parents=True, exist_ok=True)
    replace_file(file, (json.dumps(row) + "\n").encode())
    return row


def undisturbed(out: Path, scenes: int, cell: Cell) -> Row:
    """Plays random scenes in which nothing attacks, each to its end or to a contact."""
    file = out / "undisturbed" / f"{cell.scenario}-{cell.ego}-{scenes}.json"
    if file.exists():
        known: Row = json.loads(file.read_text())
        return known
    random, hits, refused, played = np.random.default_rng(cell.seed), Counter[str](), 0, 0
    spec = RunSpec(family=cell.scenario, method="no-adversary", seed=cell.seed, ego=ego_of(cell.ego))
    with closing(RiskSacEnv.of(spec)) as env:
        idle = np.zeros(env.action_size, dtype=np.float32)
        while played < scenes:
            try:
                env.reset(seed=int(random.integers(1 << 30)))
            except InfeasibleScene:
                refused += 1
                continue
            ended = False
            while not ended:
                _, _, terminated, truncated, info = env.step(idle)
                ended = terminated or truncated
            played += 1
            if "collision" in info:
                hits[info["collision"].other_id] += 1
    others = " ".join(f"{name}:{count}" for name, count in hits.most_common())
    return kept(file, cell._asdict() | {"scenes": played, "refused": refused, "contacts": hits.total(), "with": others})


def search(out: Path, episodes: int, steps: float, cell: Cell) -> Row:
    """Plays a search, or goes on with it, and replays its failures."""
    spec = RunSpec(
        family=cell.scenario,
        method=cell.method,
        seed=cell.seed,
        ego=pinned(ego_of(cell.ego)),
        budget=Budget(episodes=episodes),
    )
    folder = out / "runs" / "-".join((*cell[:3], str(cell.seed), str(episodes), f"{steps:g}"))
    file = folder / "row.json"
    if file.exists():
        known: Row = json.loads(file.read_text())
        return known
    if not ((folder / RESULTS).exists() and read_results(folder).finished):
        recorder = Recorder(spec, folder, Until(steps))
        recorder.finish(execute_run(spec, folder, recorder))
    verify([folder])
    metrics = read_results(folder).metrics
    assert metrics is not None  # the run has a search
    records = [each for each in records_from_lines((folder / EPISODES).read_bytes()) if each.searching]
    figures = {
        "episodes": metrics.episodes,
        "rejected": metrics.rejected,
        "failures": metrics.failures,
        "distinct": metrics.distinct_failures,
        "preventable": metrics.distinct_preventable,
        "candidates": metrics.headline_candidates,
        "headline": metrics.headline,
    }
    return kept(file, cell._asdict() | figures | dict(plausibility(records)) | {"steps": metrics.environment_steps})


def plausibility(records: Sequence[EpisodeRecord]) -> Iterator[tuple[str, int]]:
    """Counts kinds of valid violations by the most plausible behaviour that led to them."""
    order = list(PlausibilityClass)
    best: dict[str, PlausibilityClass] = {}
    for violation in (each for record in records for each in record.valid_violations):
        if violation.behaviour is not None:
            kind, verdict = violation.kind, violation.behaviour.verdict
            best[kind] = min(best.get(kind, verdict), verdict, key=order.index)
    counts = Counter(best.values())
    yield from ((str(name), counts[name]) for name in order)


def main() -> None:
    """Plays what is missing."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("what", choices=EGOS)
    parser.add_argument("--scenario", dest="scenarios", nargs="+", choices=shipped_names(), default=NEWEST_FIRST)
    parser.add_argument("--egos", nargs="+", metavar="EGO")
    parser.add_argument("--methods", nargs="+", choices=METHODS, default=METHODS)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--first-seed", type=int, default=FIRST_SEED)
    parser.add_argument("--episodes", type=int, default=150, help="of each search (default: %(default)s)")
    parser.add_argument("--steps", type=float, default=math.inf, help="of each search, at most (default: no bound)")
    parser.add_argument("--scenes", type=int, default=500, help="undisturbed ones (default: %(default)s)")
    parser.add_argument("--jobs", type=int, default=1)
    options = parser.parse_args()
    egos, file = options.egos or EGOS[options.what], options.out / f"{options.what}.csv"
    if options.what == "undisturbed":
        cells = [Cell(name, ego, "", UNDISTURBED_SEED) for ego, name in product(egos, options.scenarios)]
        play = partial(undisturbed, options.out, options.scenes)
    else:
        seeds = range(options.first_seed, options.first_seed + options.seeds)
        # Seeds outermost, and the two quick methods before the two that learn.
        pairs = [options.methods[:2], options.methods[2:]]
        cells = [
            Cell(name, ego, method, seed)
            for seed, pair, ego, name in product(seeds, pairs, egos, options.scenarios)
            for method in pair
        ]
        play = partial(search, options.out, options.episodes, options.steps)
    rows_of(play, cells, options.jobs, file)
    print(file.read_text())


if __name__ == "__main__":
    main()
