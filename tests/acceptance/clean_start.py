"""Overlaps of bodies before failures, and refused scenes, by family and method.

    python -m tests.acceptance.clean_start OUT [--episodes 500] [--seed 11]

plays one run after the other into folders below OUT, leaves out those that are finished there, and prints a table.
"""

import argparse
import subprocess
import sys
from collections import Counter
from pathlib import Path
from typing import NamedTuple

from risk_sac.records import EpisodeRecord, Outcome
from risk_sac.run_folder.arrays import read_series
from risk_sac.run_folder.results import EPISODES, FAILURES, RESULTS, read_results, records_from_lines, series_name
from tests.overlaps import overlaps_in

FAMILIES = ("low", "mixed", "dense")
METHODS = ("archive", "random")


class Row(NamedTuple):
    """One run."""

    episodes: int
    rejected: Counter[str]  # by reason
    contacts: int
    overlapping: int  # contacts before which bodies overlapped
    valid: int  # contacts
    unclean: int  # of the valid, those before which bodies overlapped
    distinct: int  # of all failures


def row_of(folder: Path) -> Row:
    """Counts the contacts of a finished run."""
    records = records_from_lines((folder / EPISODES).read_bytes())
    contacts = [record for record in records if record.collision is not None]
    overlap = {record.index: is_unclean(folder, record) for record in contacts}
    valid = [record for record in contacts if record.collision and record.collision.valid]
    metrics = read_results(folder).metrics
    return Row(
        episodes=len(records),
        rejected=Counter(record.reason for record in records if record.outcome is Outcome.REJECTED),
        contacts=len(contacts),
        overlapping=sum(overlap.values()),
        valid=len(valid),
        unclean=sum(overlap[record.index] for record in valid),
        distinct=0 if metrics is None else metrics.distinct_failures,
    )


def is_unclean(folder: Path, record: EpisodeRecord) -> bool:
    """Whether bodies overlapped before the contact of an episode."""
    return bool(overlaps_in(read_series(folder / FAILURES / series_name(record.index))))


def main() -> None:
    """Plays what is missing, and prints the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--episodes", type=int, default=500)
    parser.add_argument("--seed", type=int, default=11)
    options = parser.parse_args()
    print(
        "| family | method | episodes | rejected | contacts | after an overlap | valid | after an overlap | distinct |"
    )
    print("|---|---|---|---|---|---|---|---|---|")
    for family in FAMILIES:
        for method in (name for name in METHODS if name != "boundary"):
            folder = options.out / f"{family}-{method}"
            if not (folder / RESULTS).exists() or not read_results(folder).finished:
                budget = ("--episodes", str(options.episodes), "--seed", str(options.seed))
                command = [sys.executable, "-m", "risk_sac", "run", "--scenario", family, "--method", method, *budget]
                subprocess.run([*command, "--out", str(folder)], check=True, stdout=subprocess.DEVNULL)
            row = row_of(folder)
            reasons = ", ".join(f"{count} {reason}" for reason, count in row.rejected.most_common()) or "0"
            cells = (row.episodes, reasons, row.contacts, row.overlapping, row.valid, row.unclean, row.distinct)
            print(f"| {family} | {method} | {' | '.join(map(str, cells))} |", flush=True)


if __name__ == "__main__":
    main()
