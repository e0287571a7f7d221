"""Draws failures by requirement: three methods against three egos.

    python -m risk_sac.lab.figures.by_requirement OUT [--seeds N] [--episodes N]

plays what OUT lacks, seed by seed, and then draws OUT/failures_<family>.png and writes OUT/by_requirement.csv from the
runs that have ended. SUMO's driver is `default`; the other egos are those of tests/egos.
"""

import argparse
import csv
import os
import subprocess
import sys
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

from matplotlib.figure import Figure

from risk_sac.errors import RiskSacError
from risk_sac.run_folder.results import read_results

EGOS = ("default", "red-runner", "off-roader")
METHODS = ("random", "archive", "risk-sac")
FAMILIES = ("low", "mixed", "dense")
COLUMNS = ("family", "ego", "method", "seed", "requirement", "episodes", "violated", "valid", "distinct")
FIRST_SEED = 301


def play(out: Path, seeds: int, episodes: int) -> None:
    """Plays all runs, seeds outermost, so that what has ended compares all egos and methods."""
    path = os.pathsep.join(filter(None, (str(Path(__file__).parents[1] / "egos"), os.environ.get("PYTHONPATH"))))
    for seed in range(FIRST_SEED, FIRST_SEED + seeds):
        for ego in EGOS:
            arguments = ["--scenario", *FAMILIES, "--methods", *METHODS, "--seeds", "1", "--first-seed", str(seed)]
            arguments += ["--episodes", str(episodes), "--ego", ego, "--verify", "0", "--jobs", "1"]
            arguments += ["--out", str(out / f"{ego}-{seed}")]
            command = [sys.executable, "-m", "risk_sac", "evaluate", *arguments]
            subprocess.run(command, check=True, env=os.environ | {"PYTHONPATH": path}, stdout=subprocess.DEVNULL)


def rows(out: Path) -> Iterator[dict[str, object]]:
    """The funnel of each requirement that counts, in each run that has ended."""
    for ego in EGOS:
        for folder in sorted(out.glob(f"{ego}-*/runs/*")):
            try:
                results = read_results(folder)
            except (RiskSacError, OSError):
                continue
            spec, metrics = results.spec, results.metrics
            if metrics is None or not results.finished:
                continue
            for name, counts in metrics.requirements.items():
                if counts.counts == "failure":
                    head = (spec.family, ego, spec.method, spec.seed, name, metrics.rated)
                    steps = (counts.violated, counts.valid, counts.distinct)
                    yield dict(zip(COLUMNS, (*head, *steps), strict=True))


def draw(out: Path, requirement_rows: list[dict[str, object]], family: str) -> None:
    """Draws mean failures per 100 episodes by requirement; a dot is a seed."""
    figure = Figure(figsize=(10, 3.6), layout="constrained")
    axes = figure.subplots(1, len(EGOS), sharey=True)
    names = list(dict.fromkeys(str(row["requirement"]) for row in requirement_rows if row["family"] == family))
    for axis, ego in zip(axes, EGOS, strict=True):
        for i, name in enumerate(names):
            shares = defaultdict(list)
            for row in requirement_rows:
                if (row["family"], row["ego"], row["requirement"]) == (family, ego, name):
                    shares[row["method"]].append(100 * int(str(row["valid"])) / max(1, int(str(row["episodes"]))))
            at = [m + (i - (len(names) - 1) / 2) * 0.8 / len(names) for m in range(len(METHODS))]
            means = [sum(shares[m]) / len(shares[m]) if shares[m] else 0.0 for m in METHODS]
            axis.bar(at, means, 0.8 / len(names), label=name)
            for x, method in zip(at, METHODS, strict=True):
                axis.plot([x] * len(shares[method]), shares[method], "k.", markersize=4)
        axis.set_xticks(range(len(METHODS)), METHODS)
        axis.set_title(f"{family}: {ego}")
    axes[0].set_ylabel("failures per 100 episodes")
    axes[-1].legend(fontsize="small")
    figure.savefig(out / f"failures_{family}.png", dpi=110)


def main() -> None:
    """Plays, draws and writes."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--episodes", type=int, default=300)
    given = parser.parse_args()
    play(given.out, given.seeds, given.episodes)
    requirement_rows = list(rows(given.out))
    with (given.out / "by_requirement.csv").open("w", newline="") as file:
        table = csv.DictWriter(file, COLUMNS)
        table.writeheader()
        table.writerows(requirement_rows)
    for family in FAMILIES:
        draw(given.out, requirement_rows, family)


if __name__ == "__main__":
    main()
