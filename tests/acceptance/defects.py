"""Which defects of the catalogue are admitted, by runs that this command repeats.

    python -m tests.acceptance.defects OUT [--defects NAME ...] [--scenes N] [--steps N] [--seeds N]

plays what OUT lacks: for each defect and family, undisturbed scenes, and searches up to the first that detects the
defect. It rewrites OUT/admission.csv after each run. A row is admitted in a family if a search detects the defect there
and the undisturbed scenes do not.
"""

import argparse
import csv
import shutil
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

from risk_sac.benchmark.detection import ANSWER, Detection, first_detection
from risk_sac.config import Budget, RunSpec
from risk_sac.config.spec_file import read_ego
from risk_sac.egos.defects.catalogue import DEFECTS, version_of

UNDISTURBED, METHODS, FIRST_SEED = "iid-undisturbed", ("archive", "random"), 501
COLUMNS = ("defect", "family", "method", "seed", "steps", "episodes", "reached", "triggered", "detected", "refuted")


def played(name: str, family: str, options: argparse.Namespace) -> Iterator[Detection]:
    """Yields the undisturbed run of a defect in a family, and then searches up to a detection."""
    ego = read_ego(f"{DEFECTS[name].base}+{name}")
    searches = [(method, FIRST_SEED + k) for k in range(options.seeds) for method in METHODS]
    for method, seed in [(UNDISTURBED, FIRST_SEED), *searches]:
        spec = RunSpec(family=family, method=method, seed=seed, ego=ego, budget=Budget(episodes=options.scenes))
        budget = f"{options.scenes}-scenes" if spec.iid else f"{options.steps}-steps"
        folder = options.out / "-".join((name, version_of(ego), spec.id, budget))
        detection = first_detection(spec, folder, sys.maxsize if spec.iid else options.steps)
        for path in folder.iterdir():  # what a finished run leaves
            if path.name != ANSWER:
                shutil.rmtree(path) if path.is_dir() else path.unlink()
        yield detection
        if detection.detected is not None and not spec.iid:
            return


def main() -> None:
    """Plays what is missing."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--defects", nargs="+", default=list(DEFECTS), choices=DEFECTS, metavar="NAME")
    parser.add_argument("--scenes", type=int, default=500, help="undisturbed ones (default: %(default)s)")
    parser.add_argument("--steps", type=int, default=20_000, help="of each search (default: %(default)s)")
    parser.add_argument("--seeds", type=int, default=1, help="of each search (default: %(default)s)")
    options = parser.parse_args()
    found: list[Detection] = []
    pairs = [(name, family) for name in options.defects for family in DEFECTS[name].families]
    for name, family in pairs:
        for detection in played(name, family, options):
            found.append(detection)
            write(options.out / "admission.csv", found)


def write(file: Path, found: Sequence[Detection]) -> None:
    """Writes a row for each run."""
    with file.open("w", newline="") as opened:
        writer = csv.writer(opened)
        writer.writerow((*COLUMNS, "signature"))
        for each in found:
            told = each.model_dump() | {"defect": "+".join(each.defects)}
            writer.writerow(told[name] for name in (*COLUMNS, "signature"))


if __name__ == "__main__":
    main()
