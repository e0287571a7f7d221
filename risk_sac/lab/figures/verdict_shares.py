"""Judges valid contacts again and compares the shares of verdicts.

    python -m risk_sac.lab.figures.verdict_shares OUT [--egos NAME ...] [--episodes N] [--seed N]

plays an archive search per ego and family that OUT lacks, judges every valid contact of the runs again from its
recording, and writes OUT/verdicts.csv and OUT/verdicts.md. A folder of an older version keeps its verdicts as `before`.
"""

import argparse
import csv
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import NamedTuple

from risk_sac.config import EgoConfig, RunSpec
from risk_sac.env.problem import Problem
from risk_sac.failures.recording import Series
from risk_sac.records import Collision, EpisodeRecord, Fault, Grade, Judgement, Severity
from risk_sac.run_folder.arrays import read_series
from risk_sac.run_folder.results import read_results
from risk_sac.verdicts.evidence import Evidence, Ground
from risk_sac.verdicts.judge import judge
from risk_sac.verdicts.reference import DRIVERS

FAMILIES = ("low", "mixed", "dense")
COLUMNS = ("family", "ego", "rules", "by", "name", "contacts", "valid")
NAMES: Mapping[str, Sequence[str]] = {
    "fault": list(Fault),
    "severity": list(Severity),
    "grade": list(Grade),
    "prevented by": [*DRIVERS, "r157_ttc"],
}


class JudgedAgain(NamedTuple):
    """A valid contact, with both verdicts."""

    episode: EpisodeRecord
    hit: Collision
    before: Judgement
    now: Judgement
    series: Series


def play(folder: Path, ego: str, family: str, seed: int, episodes: int) -> None:
    """Plays a run, or goes on with it."""
    search = ["--scenario", family, "--method", "archive", "--seed", str(seed), "--episodes", str(episodes)]
    command = [sys.executable, "-m", "risk_sac", "run", *search, "--ego", ego, "--out", str(folder)]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)


def evidence_of(spec: RunSpec, episode: EpisodeRecord, series: Series) -> Evidence:
    """Returns what a judge may look at of a recorded episode."""
    problem = _problem(
        spec.model_copy(update={"ego": EgoConfig()}).model_dump_json()
    )  # any ego: the place is asked for
    ground = Ground.of(problem.family.layout(episode.scene), problem.speed_limit_mps)
    return Evidence.from_series(series, ground, float(series["released_s"]))


@cache
def _problem(spec: str) -> Problem:
    return Problem.from_spec(RunSpec.model_validate_json(spec))


def judged_again(folder: Path) -> Iterator[JudgedAgain]:
    """Judges the valid contacts of a run again."""
    results = read_results(folder)
    for failure in results.failures:
        hit = failure.episode.collision
        if hit is None or not hit.valid:
            continue
        series = read_series(folder / failure.series)
        now = judge(evidence_of(results.spec, failure.episode, series), hit.other_id, valid=True)
        yield JudgedAgain(failure.episode, hit, hit.judgement, now, series)


def shares(judgements: Sequence[Judgement]) -> Iterator[tuple[str, str, int]]:
    """Counts contacts: by what, its name, and how many."""
    for by, names in NAMES.items():
        if by == "prevented by":
            found = Counter(name for each in judgements for name, driver in each.drivers.items() if driver.avoids)
        else:
            found = Counter(str(getattr(each, by) or "") for each in judgements)
        for name in [*names, ""]:
            if name or found[""]:
                yield by, str(name) or "not recorded", found[str(name)]


def rows(out: Path, egos: Sequence[str]) -> Iterator[dict[str, object]]:
    """The rows of verdicts.csv."""
    for ego in egos:
        for family in FAMILIES:
            folder = out / f"{ego}-{family}"
            contacts = list(judged_again(folder)) if folder.exists() else []
            rules = {"before": [each.before for each in contacts], "now": [each.now for each in contacts]}
            for name, judgements in rules.items():
                for share in shares(judgements):
                    yield dict(zip(COLUMNS, (family, ego, name, *share, len(contacts)), strict=True))


def markdown(share_rows: Sequence[dict[str, object]]) -> str:
    """A table: a row per share, a column per ego and family, before → now."""
    columns = list(dict.fromkeys((row["ego"], row["family"], row["valid"]) for row in share_rows))
    lines = ["| | " + " | ".join(f"{ego}, {family} ({valid})" for ego, family, valid in columns) + " |"]
    lines.append("|---|" + "---|" * len(columns))
    cells = {(r["ego"], r["family"], r["rules"], r["by"], r["name"]): r["contacts"] for r in share_rows}
    for by, name in dict.fromkeys((row["by"], row["name"]) for row in share_rows):
        shown = []
        for ego, family, _ in columns:
            before, now = (cells.get((ego, family, rules, by, name), "–") for rules in ("before", "now"))
            shown.append(f"{before} → {now}")
        lines.append(f"| {by}: {name} | " + " | ".join(shown) + " |")
    return "\n".join(lines) + "\n"


def main() -> None:
    """Plays, judges and writes."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--egos", nargs="+", default=["default"])
    parser.add_argument("--episodes", type=int, default=300, help="0 plays nothing")
    parser.add_argument("--seed", type=int, default=901)
    given = parser.parse_args()
    if given.episodes:
        for ego in given.egos:
            for family in FAMILIES:
                play(given.out / f"{ego}-{family}", ego, family, given.seed, given.episodes)
    share_rows = list(rows(given.out, given.egos))
    with (given.out / "verdicts.csv").open("w", newline="") as file:
        table = csv.DictWriter(file, COLUMNS)
        table.writeheader()
        table.writerows(share_rows)
    (given.out / "verdicts.md").write_text(markdown(share_rows))


if __name__ == "__main__":
    main()
