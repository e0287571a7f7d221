"""Measures which defects of the catalogue are admitted.

    python -m risk_sac.lab.figures.defects OUT [--defects NAME ...] [--scenes N] [--steps N] [--seeds N]

plays what OUT, a folder of `risk-sac benchmark`, lacks: searches up to the first that detects the defect, and
undisturbed scenes. It rewrites OUT/admission.csv after each defect. A row is admitted in the first of its families if a
search detects the defect there and the undisturbed scenes do not.
"""

import argparse
import csv
import io
import sys
from collections.abc import Iterator
from pathlib import Path

from risk_sac.config import MethodName, RunSpec
from risk_sac.egos.defects.catalogue import DEFECTS, version_of
from risk_sac.egos.registry import pinned
from risk_sac.errors import RiskSacError
from risk_sac.lab.benchmark.runs import Benchmark, Detection, ego_with, ended, first_detection, folder_of
from risk_sac.run_folder.durable import replace_file

UNDISTURBED = "iid-undisturbed"
METHODS: tuple[MethodName, ...] = ("archive", "random")
FIRST_SEED = 1
SCENE_STEPS = 150  # steps of a whole scene; shorter scenes make it more scenes
COLUMNS = ("defect", "version", "family", "undisturbed_scenes", "undisturbed_detected", "method", "seed", "detected")


def undisturbed(name: str, options: argparse.Namespace) -> Detection:
    """Plays undisturbed scenes of a defect up to one that detects it."""
    spec = RunSpec(family=DEFECTS[name].families[0], method=UNDISTURBED, seed=501, ego=pinned(ego_with(name)))
    return first_detection(spec, folder_of(spec, options.out), options.scenes * SCENE_STEPS)


def search(name: str, options: argparse.Namespace) -> Detection | None:
    """Returns the quickest detection in OUT; without one, plays searches up to the first detection."""
    seeds = tuple(range(FIRST_SEED, FIRST_SEED + options.seeds))
    searches = Benchmark(methods=METHODS, defects=(name,), seeds=seeds, budget_steps=options.steps)
    found = [(each.detected, each) for each in ended(searches, options.out) if each.detected is not None]
    if found:
        return min(found, key=lambda each: each[0])[1]
    played = (first_detection(spec, folder_of(spec, options.out), options.steps) for spec in searches.specs())
    return next((each for each in played if each.detected is not None), None)


def rows(options: argparse.Namespace) -> Iterator[tuple[object, ...]]:
    """Yields a row of admission.csv for each defect."""
    for name in options.defects:
        try:
            clean, detection = undisturbed(name, options), search(name, options)
        except RiskSacError as error:
            print(f"{name}: {error}", file=sys.stderr)
            continue
        hit = (detection.method, detection.seed, detection.detected) if detection else ("", "", "")
        version = version_of(ego_with(name))
        yield name, version, clean.family, clean.episodes, int(clean.detected is not None), *hit


def main() -> None:
    """Plays what is missing."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--defects", nargs="+", default=list(DEFECTS), choices=DEFECTS, metavar="NAME")
    parser.add_argument("--scenes", type=int, default=500, help="undisturbed ones (default: %(default)s)")
    parser.add_argument("--steps", type=int, default=60_000, help="of each search (default: %(default)s)")
    parser.add_argument("--seeds", type=int, default=1, help="of each search (default: %(default)s)")
    options = parser.parse_args()
    admission_rows: list[tuple[object, ...]] = []
    for row in rows(options):
        admission_rows.append(row)
        text = io.StringIO()
        csv.writer(text, lineterminator="\n").writerows([COLUMNS, *admission_rows])
        replace_file(options.out / "admission.csv", text.getvalue().encode())


if __name__ == "__main__":
    main()
