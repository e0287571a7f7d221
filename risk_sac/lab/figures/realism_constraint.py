"""Compares the realism cost of `risk-sac`, which λ bounds, with that of `sac`, which nothing bounds.

    python -m risk_sac.lab.figures.realism_constraint OUT [--scenario mixed] [--limit D] [--episodes 1000] [--jobs 2]

plays what OUT lacks and writes OUT/table.md: per family the mean cost d over the last 200 episodes of both methods. An
interrupted run goes on where it was; `--table` only reads what there is. λ can bind only where the limit is below what
`sac` costs.
"""

import argparse
import json
import subprocess
import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from statistics import fmean

from risk_sac.config import FamilyName
from risk_sac.records import EpisodeRecord
from risk_sac.run_folder.results import EPISODES, RESULTS, records_from_lines

FAMILIES: tuple[FamilyName, ...] = ("low", "mixed", "dense")
METHODS = ("risk-sac", "sac")
LAST = 200  # episodes that are compared
HEAD = "| family | episodes | limit | d of risk-sac | d of sac | ratio | λ |\n|---|---|---|---|---|---|---|"


def play(options: argparse.Namespace, family: FamilyName, method: str) -> None:
    """Plays a run in a process of its own, which learns with one thread."""
    arguments = ["run", "--scenario", family, "--method", method, "--ego", options.ego, "--seed", str(options.seed)]
    arguments += ["--episodes", str(options.episodes), "--prior", "none", "--out", str(options.out / family / method)]
    if options.limit is not None and method == METHODS[0]:
        options.out.mkdir(parents=True, exist_ok=True)
        settings = options.out / "limit.yaml"
        settings.write_text(f"learner: {{lagrangian: {{cost_limit: {options.limit}}}}}\n")
        arguments += ["--spec", str(settings)]
    subprocess.run([sys.executable, "-m", "risk_sac", *arguments], check=True, stdout=subprocess.DEVNULL)


def row(family: str, limit: float, constrained: Sequence[EpisodeRecord], free: Sequence[EpisodeRecord]) -> str:
    """Compares two runs over the last episodes that both have played; `limit` is that of the constrained one."""
    count = min(len(constrained), len(free))
    last = slice(max(count - LAST, 0), count)
    kept, spent = (fmean(episode.mean_cost for episode in run[last]) for run in (constrained, free))
    ratio = f"{spent / kept:.2f}" if kept else "–"
    dual_variable = constrained[count - 1].dual_variable
    return f"| {family} | {count} | {limit} | {kept:.3f} | {spent:.3f} | {ratio} | {dual_variable:.2f} |"


def rows(out: Path) -> Iterator[str]:
    """Lists the families that both methods have begun."""
    for family in FAMILIES:
        files = [out / family / method / EPISODES for method in METHODS]
        if all(file.exists() and file.stat().st_size for file in files):
            constrained, free = (records_from_lines(file.read_bytes()) for file in files)
            spec = json.loads((out / family / METHODS[0] / RESULTS).read_bytes())["spec"]
            yield row(family, spec["learner"]["lagrangian"]["cost_limit"], constrained, free)


def main() -> None:
    """Plays what is missing and writes the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--scenario", dest="family", choices=FAMILIES, action="append")
    parser.add_argument("--limit", type=float, help="cost limit of risk-sac, in [0, 1]; default: that of the learner")
    parser.add_argument("--ego", default="idm-aeb")
    parser.add_argument("--episodes", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=7)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--table", action="store_true", help="play nothing")
    options = parser.parse_args()
    if not options.table:
        runs = [(family, method) for family in options.family or FAMILIES for method in METHODS]
        with ThreadPoolExecutor(options.jobs) as pool:
            list(pool.map(lambda run: play(options, *run), runs))
    table = "\n".join([HEAD, *rows(options.out)])
    (options.out / "table.md").write_text(table + "\n")
    print(table)


if __name__ == "__main__":
    main()
