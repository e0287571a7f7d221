"""Counts headline failures of better and worse egos.

    python -m risk_sac.lab.figures.ego_ladder OUT [--scenario NAME ...] [--seeds N] [--steps N]

plays what OUT lacks, seed by seed, and writes OUT/ladder.csv and OUT/ladder.md from the runs that have ended. A run
ends with the episode in which it has spent its steps; without its ladder.json it is counted again, by the rules of now.
A headline failure is distinct, preventable, plausible, not minor, and was the same again in a process of its own.
"""

import argparse
import csv
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from statistics import mean
from typing import Any

from risk_sac.config import EgoConfig, RunSpec
from risk_sac.env.env import RiskSacEnv
from risk_sac.env.problem import Problem
from risk_sac.errors import SimulationError
from risk_sac.failures.play import repeated
from risk_sac.failures.recording import Series
from risk_sac.lab.figures.verdict_shares import evidence_of
from risk_sac.records import Collision, EpisodeRecord, RunMetrics, SeriesFile, Severity, Violation
from risk_sac.run_folder.arrays import read_series
from risk_sac.run_folder.durable import replace_file
from risk_sac.run_folder.results import EPISODES, FAILURES, records_from_lines, series_name
from risk_sac.search.loop import execute_run
from risk_sac.verdicts.distinct import DistinctFailures
from risk_sac.verdicts.judge import judge

EGOS = {
    "broken": EgoConfig(driver="broken"),
    "reaction 1.0 s": EgoConfig(reaction_time_s=1.0),
    "reaction 0.5 s": EgoConfig(),
    "reaction 0.1 s": EgoConfig(reaction_time_s=0.1),
    "idm-aeb": EgoConfig(driver="idm-aeb"),
    "rss": EgoConfig(driver="rss"),
    "r157": EgoConfig(driver="r157"),
    "defensive": EgoConfig(profile="defensive"),
}
FAMILIES = ("low", "mixed")
FIRST_SEED = 941
STEPS = 10_000
DONE = "ladder.json"
COUNTS = ("episodes", "steps", "contacts", "valid", "preventable", "preventable_not_minor", "headline")
COLUMNS = ("family", "ego", "seed", *COUNTS)


@dataclass
class StepBudget:
    """Stops a run that has spent its steps, and keeps its episodes."""

    steps: int
    file: Path

    def __post_init__(self) -> None:
        self._records: list[EpisodeRecord] = []

    def episode(self, record: EpisodeRecord, metrics: RunMetrics, series: SeriesFile | None) -> None:
        """Keeps an episode."""
        self._records.append(record)

    def should_stop(self) -> bool:
        """Whether the steps are spent."""
        return sum(record.steps for record in self._records) >= self.steps

    def save(self) -> None:
        """Writes the episodes in one step."""
        replace_file(self.file, b"".join(record.model_dump_json().encode() + b"\n" for record in self._records))


def spec_of(family: str, ego: str, seed: int, steps: int) -> RunSpec:
    """The run of an ego; it may play an episode a step, which is more than it needs."""
    budget = {"episodes": steps}
    spec = RunSpec.model_validate({"family": family, "method": "archive", "seed": seed, "budget": budget})
    return spec.model_copy(update={"ego": Problem.from_spec(spec.model_copy(update={"ego": EGOS[ego]})).ego})


def play(spec: RunSpec, folder: Path, steps: int) -> None:
    """Plays a run, or goes on with it."""
    observer = StepBudget(steps, folder / EPISODES)
    execute_run(spec, folder, observer)
    observer.save()


def count(spec: RunSpec, folder: Path) -> Mapping[str, int]:
    """Counts the steps of the funnel, judged again by the present rules."""
    records = [judged_now(spec, each, folder) for each in records_from_lines((folder / EPISODES).read_bytes())]
    valid = [(record, each) for record in records for each in record.valid_violations]
    preventable = [(record, each) for record, each in valid if each.preventable]
    bad = [(record, each) for record, each in preventable if not _minor(each)]
    distinct, headline = DistinctFailures(), 0
    with closing(RiskSacEnv.of(spec)) as env:
        for record, each in bad:
            headline += distinct.add(each) and _repeats(env, spec, record, folder)
    found = sum(record.collision is not None for record in records), len(valid), len(preventable), len(bad), headline
    return dict(zip(COUNTS, (len(records), sum(record.steps for record in records), *found), strict=True))


def judged_now(spec: RunSpec, record: EpisodeRecord, folder: Path) -> EpisodeRecord:
    """Judges the valid contact of an episode again from its recording."""
    hit = record.collision
    if hit is None or not hit.valid:
        return record
    evidence = evidence_of(spec, record, _series(record, folder))
    judgement = judge(evidence, hit.other_id, valid=True)
    return record.model_copy(update={"collision": hit.model_copy(update={"judgement": judgement})})


def _series(record: EpisodeRecord, folder: Path) -> Series:
    return read_series(folder / FAILURES / series_name(record.index))


def _minor(violation: Collision | Violation) -> bool:
    return isinstance(violation, Collision) and violation.severity is Severity.MINOR


def _repeats(env: RiskSacEnv, spec: RunSpec, record: EpisodeRecord, folder: Path) -> bool:
    try:
        repeated(env, spec, record, _series(record, folder))
    except SimulationError:
        return False
    return True


def play_all(out: Path, families: Sequence[str], seeds: int, steps: int) -> None:
    """Plays all runs, seeds outermost, so that what has ended compares all egos."""
    for seed in range(FIRST_SEED, FIRST_SEED + seeds):
        for family in families:
            for ego in EGOS:
                folder = out / f"{family}-{ego.replace(' ', '-')}-{seed}"
                if not (folder / DONE).exists():
                    spec = spec_of(family, ego, seed, steps)
                    if not (folder / EPISODES).exists():
                        in_own_process(play, spec, folder, steps)
                    counts = in_own_process(count, spec, folder)
                    row = {"family": family, "ego": ego, "seed": seed} | counts
                    replace_file(folder / DONE, json.dumps(row).encode())
                    write(out)


def in_own_process(call: Callable[..., Any], *arguments: object) -> Any:
    """Returns what a call returns in a fresh process: there is one simulation a process."""
    with get_context("spawn").Pool(1) as pool:
        return pool.apply(call, arguments)


def write(out: Path) -> None:
    """Writes the runs that have ended."""
    rows = sorted((json.loads(file.read_bytes()) for file in out.glob(f"*/{DONE}")), key=_order)
    with (out / "ladder.csv").open("w", newline="") as file:
        table = csv.DictWriter(file, COLUMNS)
        table.writeheader()
        table.writerows(rows)
    (out / "ladder.md").write_text("\n".join(_lines(rows)) + "\n")


def _order(row: Mapping[str, Any]) -> tuple[str, int, int]:
    return row["family"], list(EGOS).index(row["ego"]), row["seed"]


def _lines(rows: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """A line per family and ego: means over the seeds, and the headline of each."""
    yield "| family | ego | seeds | episodes | contacts | valid | preventable | headline | of each seed |"
    yield "|---|---|---|---|---|---|---|---|---|"
    for family, ego in dict.fromkeys((row["family"], row["ego"]) for row in rows):
        runs = [row for row in rows if (row["family"], row["ego"]) == (family, ego)]
        means = [f"{mean(run[name] for run in runs):.1f}" for name in ("episodes", "contacts", "valid", "preventable")]
        headline = [run["headline"] for run in runs]
        cells = [family, ego, str(len(runs)), *means, f"{mean(headline):.1f}", ", ".join(map(str, headline))]
        yield f"| {' | '.join(cells)} |"


def main() -> None:
    """Plays, counts and writes."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--scenario", dest="families", nargs="+", default=FAMILIES)
    parser.add_argument("--seeds", type=int, default=4)
    parser.add_argument("--steps", type=int, default=STEPS)
    given = parser.parse_args()
    play_all(given.out, given.families, given.seeds, given.steps)
    write(given.out)


if __name__ == "__main__":
    main()
