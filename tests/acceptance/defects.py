"""Which defects of the catalogue are admitted, by runs that this command repeats.

    python -m tests.acceptance.defects OUT [--defects NAME ...] [--scenes N] [--steps N] [--seeds N]

plays what OUT lacks: for each defect and family, undisturbed scenes, and searches up to the first that detects the
defect. It rewrites OUT/admission.csv after each run. A row is admitted in a family if a search detects the defect there
and the undisturbed scenes do not.
"""

import argparse
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path

from risk_sac.benchmark.detection import ANSWER, Detection, first_detection
from risk_sac.benchmark.runs import ego_with, folder_of
from risk_sac.benchmark.table import detections_csv
from risk_sac.config import Budget, RunSpec
from risk_sac.egos.defects.catalogue import DEFECTS
from risk_sac.egos.registry import pinned
from risk_sac.run_folder.durable import replace_file

UNDISTURBED, METHODS, FIRST_SEED = "iid-undisturbed", ("archive", "random"), 501


def played(name: str, family: str, options: argparse.Namespace) -> Iterator[Detection]:
    """Yields the undisturbed run of a defect in a family, and then searches up to a detection."""
    ego = pinned(ego_with(name))
    searches = [(method, FIRST_SEED + k) for k in range(options.seeds) for method in METHODS]
    for method, seed in [(UNDISTURBED, FIRST_SEED), *searches]:
        spec = RunSpec(family=family, method=method, seed=seed, ego=ego, budget=Budget(episodes=options.scenes))
        folder = folder_of(spec, options.out, options.scenes if spec.iid else options.steps)
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
    pairs = [
        (name, DEFECTS[name].families[k])  # so that each defect is soon played in some family
        for k in range(3)
        for name in options.defects
        if k < len(DEFECTS[name].families)
    ]
    for name, family in pairs:
        for detection in played(name, family, options):
            found.append(detection)
            replace_file(options.out / "admission.csv", detections_csv(found))


if __name__ == "__main__":
    main()
