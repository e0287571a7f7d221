"""What archive and random search find in a planner: equal environment steps, several seeds.

    python -m tests.acceptance.planner_table OUT [--ego NAME] [--families NAME ...] [--methods NAME ...] [--seeds N]
        [--steps N]

plays what OUT lacks, seeds outermost, and rewrites OUT/table.md and OUT/table.csv after each run from those that have
ended. A run ends with the episode in which it has spent its steps. Counts are those of `risk-sac run`; the failures are
not replayed, so the last of them are candidates of headline failures.
"""

import argparse
import csv
from collections.abc import Iterator, Sequence
from itertools import product
from pathlib import Path
from statistics import mean

from risk_sac.config import RunSpec
from risk_sac.config.spec_file import read_ego
from risk_sac.egos.registry import pinned
from risk_sac.metrics import MetricsAccumulator
from risk_sac.run_folder.results import EPISODES, records_from_lines
from risk_sac.scenario.families import family_named
from tests.acceptance.ego_ladder import in_own_process, play

FIRST_SEED = 1
COUNTS = ("distinct_failures", "distinct_preventable", "headline_candidates")
COLUMNS = ("family", "method", "seed", "episodes", "environment_steps", *COUNTS)
Row = dict[str, str | int]


def spec_of(family: str, method: str, ego: str, seed: int, steps: int) -> RunSpec:
    """The run of a method; it may play an episode a step, which is more than it needs."""
    fields = {"family": family, "method": method, "seed": seed, "budget": {"episodes": steps}}
    return RunSpec.model_validate(fields | {"ego": pinned(read_ego(ego))})


def counted(spec: RunSpec, folder: Path) -> Row:
    """Returns the counts of a run that has ended."""
    found = MetricsAccumulator(family_named(spec.family).horizon_steps)
    for record in records_from_lines((folder / EPISODES).read_bytes()):
        metrics = found.add(record)
    return {name: getattr(spec, name) if hasattr(spec, name) else getattr(metrics, name) for name in COLUMNS}


def write(rows: Sequence[Row], out: Path) -> str:
    """Writes the runs that have ended, and returns the table."""
    with (out / "table.csv").open("w", newline="") as file:
        table = csv.DictWriter(file, COLUMNS)
        table.writeheader()
        table.writerows(rows)
    text = "\n".join(_lines(rows)) + "\n"
    (out / "table.md").write_text(text)
    return text


def _lines(rows: Sequence[Row]) -> Iterator[str]:
    """A line per family and method: means over the seeds, and in brackets each seed."""
    yield "| family | method | seeds | episodes | steps | distinct | preventable distinct | headline candidates |"
    yield "|---|---|---|---|---|---|---|---|"
    for cell in dict.fromkeys((row["family"], row["method"]) for row in rows):
        runs = [row for row in rows if (row["family"], row["method"]) == cell]
        means = [f"{mean(int(run[name]) for run in runs):.0f}" for name in ("episodes", "environment_steps")]
        each = [[int(run[name]) for run in runs] for name in COUNTS]
        counts = [f"{mean(values):.1f} ({', '.join(map(str, values))})" for values in each]
        yield f"| {' | '.join([*map(str, cell), str(len(runs)), *means, *counts])} |"


def main() -> None:
    """Plays, counts and writes."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--ego", default="fiss-plus", help="(default: %(default)s)")
    parser.add_argument("--families", nargs="+", default=["low", "mixed", "dense"], metavar="NAME")
    parser.add_argument("--methods", nargs="+", default=["archive", "random"], metavar="NAME")
    parser.add_argument("--seeds", type=int, default=5, metavar="N", help="(default: %(default)s)")
    parser.add_argument("--steps", type=int, default=20_000, metavar="N", help="of each run (default: %(default)s)")
    given = parser.parse_args()
    rows: list[Row] = []
    seeds = range(FIRST_SEED, FIRST_SEED + given.seeds)
    for seed, family, method in product(seeds, given.families, given.methods):
        spec = spec_of(family, method, given.ego, seed, given.steps)
        folder = given.out / f"{spec.id}-{given.steps}"
        if not (folder / EPISODES).exists():
            in_own_process(play, spec, folder, given.steps)
        rows.append(counted(spec, folder))
        print(write(rows, given.out))


if __name__ == "__main__":
    main()
