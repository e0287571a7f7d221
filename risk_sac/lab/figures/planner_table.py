"""Compares what archive and random search find in a planner.

    python -m risk_sac.lab.figures.planner_table OUT [--ego NAME] [--scenario NAME ...] [--methods NAME ...] [--seeds N]
        [--steps N] [--finished DIR]

plays what OUT lacks, seeds outermost, and rewrites OUT/table.md and OUT/table.csv after each run. A run ends with the
episode in which it has spent its steps; with more steps it goes on. What ends after the steps does not count, so longer
runs are cut. Counts are those of `risk-sac run`; the failures are not replayed, so the last of them are candidates of
headline failures. DIR gets each run, cut at its steps, as a finished one, for `risk-sac verify`, `show` and `report`.
"""

import argparse
import csv
import shutil
from collections.abc import Iterator, Sequence
from importlib.metadata import version
from itertools import product
from pathlib import Path
from statistics import median

from risk_sac.config import RunSpec
from risk_sac.config.spec_file import read_ego
from risk_sac.egos.registry import pinned
from risk_sac.env.problem import adjustments
from risk_sac.lab.figures.ego_ladder import in_own_process, play
from risk_sac.metrics import MetricsAccumulator, results_digest
from risk_sac.run_folder import checkpoint
from risk_sac.run_folder.results import (
    EPISODES,
    FAILURES,
    RecordedFailure,
    RunResults,
    records_from_lines,
    write_results,
)
from risk_sac.scenario.families import family_named
from risk_sac.search.run import CHECKPOINT, PACKAGES

FIRST_SEED = 1
MOST_EPISODES = 10_000  # most episodes of a run, which ends by its steps; fixed, so that it can go on with more steps
COUNTS = ("distinct_failures", "distinct_preventable", "headline_candidates")
COLUMNS = ("family", "method", "seed", "episodes", "environment_steps", *COUNTS)
Row = dict[str, str | int]


def spec_of(family: str, method: str, ego: str, seed: int) -> RunSpec:
    """Returns the run of a method."""
    fields = {"family": family, "method": method, "seed": seed, "budget": {"episodes": MOST_EPISODES}}
    return RunSpec.model_validate(fields | {"ego": pinned(read_ego(ego))})


def spent(folder: Path, steps: int) -> bool:
    """Returns whether a run has ended and spent so many steps."""
    file = folder / EPISODES
    return file.exists() and records_from_lines(file.read_bytes())[-1].environment_steps >= steps


def counted(spec: RunSpec, folder: Path, steps: int) -> Row:
    """Returns the counts of a run's episodes that end within the steps."""
    accumulator = MetricsAccumulator(family_named(spec.family).horizon_steps)
    for record in records_from_lines((folder / EPISODES).read_bytes()):
        if record.environment_steps <= steps:
            accumulator.add(record)
    metrics = accumulator.metrics()
    return {name: getattr(spec, name) if hasattr(spec, name) else getattr(metrics, name) for name in COLUMNS}


def finish(spec: RunSpec, folder: Path, steps: int, out: Path) -> None:
    """Writes a run's episodes that end within the steps as a finished run."""
    records = [each for each in records_from_lines((folder / EPISODES).read_bytes()) if each.environment_steps <= steps]
    state = checkpoint.load_newest(folder / CHECKPOINT, spec.digest) or {}
    cpu_s = tuple(state.get("episode_cpu_s", ()))[: len(records)]
    accumulator = MetricsAccumulator(family_named(spec.family).horizon_steps)
    for record in records:
        accumulator.add(record)
    shutil.copytree(folder / FAILURES, out / FAILURES, dirs_exist_ok=True)
    (out / EPISODES).write_bytes(b"".join(record.model_dump_json().encode() + b"\n" for record in records))
    results = RunResults(
        spec=spec,
        spec_digest=spec.digest,
        adjustments=adjustments(spec),
        finished=True,
        metrics=accumulator.metrics(),
        digest=results_digest(records),
        versions={name: version(name) for name in PACKAGES},
        device="cpu",
        cpu_s=cpu_s[-1] if cpu_s else 0.0,
        episode_cpu_s=cpu_s,
        failures=tuple(RecordedFailure.of(spec.id, record) for record in records if record.worst_violation),
    )
    write_results(out, results)


def write(rows: Sequence[Row], out: Path) -> str:
    """Writes the runs that have ended, and returns the table."""
    with (out / "table.csv").open("w", newline="") as file:
        table = csv.DictWriter(file, COLUMNS)
        table.writeheader()
        table.writerows(rows)
    text = "\n".join(lines(rows)) + "\n"
    (out / "table.md").write_text(text)
    return text


def lines(rows: Sequence[Row]) -> Iterator[str]:
    """Yields a line per family and method: median and range over the seeds, and p against random search."""
    yield "| family | method | seeds | distinct | preventable distinct | headline candidates |"
    yield "|---|---|---|---|---|---|"
    for family, method in dict.fromkeys((str(row["family"]), str(row["method"])) for row in rows):
        cells = [family, method, str(len(values(rows, family, method, "seed")))]
        for name in COUNTS:
            found, reference = (values(rows, family, each, name) for each in (method, "random"))
            cell = f"{median(found):g} ({min(found)} to {max(found)})"
            cells.append(cell if method == "random" or not reference else f"{cell}, p {p_value(found, reference):.2f}")
        yield f"| {' | '.join(cells)} |"


def values(rows: Sequence[Row], family: str, method: str, name: str) -> list[int]:
    """Returns what each run of a family and a method counted."""
    return [int(row[name]) for row in rows if (row["family"], row["method"]) == (family, method)]


def p_value(first: Sequence[int], second: Sequence[int]) -> float:
    """Returns the two-sided p of the Mann-Whitney test; 1 where all counts are equal."""
    from scipy.stats import mannwhitneyu

    return 1.0 if len({*first, *second}) == 1 else float(mannwhitneyu(first, second).pvalue)


def main() -> None:
    """Plays, counts and writes."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--ego", default="fiss-plus", help="(default: %(default)s)")
    parser.add_argument("--scenario", dest="families", nargs="+", default=["low", "mixed", "dense"], metavar="NAME")
    parser.add_argument("--methods", nargs="+", default=["archive", "random"], metavar="NAME")
    parser.add_argument("--seeds", type=int, default=5, metavar="N", help="(default: %(default)s)")
    parser.add_argument("--steps", type=int, default=5_000, metavar="N", help="of each run (default: %(default)s)")
    parser.add_argument("--finished", type=Path, metavar="DIR", help="folder of the finished runs")
    given = parser.parse_args()
    rows: list[Row] = []
    seeds = range(FIRST_SEED, FIRST_SEED + given.seeds)
    for seed, family, method in product(seeds, given.families, given.methods):
        spec = spec_of(family, method, given.ego, seed)
        folder = given.out / spec.id
        if not spent(folder, given.steps):
            in_own_process(play, spec, folder, given.steps)
        rows.append(counted(spec, folder, given.steps))
        if given.finished:
            finish(spec, folder, given.steps, given.finished / spec.id)
        print(write(rows, given.out))


if __name__ == "__main__":
    main()
