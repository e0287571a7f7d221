"""Measures which defects of the catalogue are admitted, and how hard random search finds conjunctions.

    python -m risk_sac.lab.figures.defects OUT [--defects NAME ...] [--scenes N] [--steps N] [--seeds N]
    python -m risk_sac.lab.figures.defects OUT --tiers

plays what OUT, a folder of `risk-sac benchmark`, lacks: searches up to the first that detects the defect, and
undisturbed scenes. It rewrites OUT/admission.csv after each defect. A row is admitted in the first of its families if a
search detects the defect there and the undisturbed scenes do not. With `--tiers` it plays nothing, and writes
OUT/tiers.csv: what the runs in OUT tell of each conjunction.
"""

import argparse
import csv
import io
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

from risk_sac.config import MethodName, RunSpec
from risk_sac.egos.defects.catalogue import DEFECTS, Tier, version_of
from risk_sac.egos.registry import pinned
from risk_sac.errors import RiskSacError
from risk_sac.lab.benchmark.runs import ANSWER, Benchmark, Detection, ego_with, ended, first_detection, folder_of
from risk_sac.run_folder.durable import replace_file

UNDISTURBED = "iid-undisturbed"
METHODS: tuple[MethodName, ...] = ("archive", "random", "risk-sac-diverse")
FIRST_SEED = 1
SCENE_STEPS = 150  # steps of a whole scene; shorter scenes make it more scenes
EASY, HARD = 0.8, 0.2  # least and largest share of runs of random search that detect
TIER_COLUMNS = (
    *("defect", "version", "family", "ego", "tier", "test_set", "random_runs", "random_detected", "random_steps"),
    *("undisturbed_scenes", "undisturbed_detected", "method", "seed", "detected"),
)
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


def tier_of(detected: int, runs: int) -> Tier:
    """Returns the tier of a defect that so many runs of random search detected."""
    return "easy" if detected >= EASY * runs else "hard" if detected <= HARD * runs else "medium"


def tier_rows(out: Path) -> Iterator[tuple[object, ...]]:
    """Yields a row of tiers.csv for each conjunction of which OUT has runs of random search.

    The last columns are of the quickest detection by any search.
    """
    for name, defect in sorted(DEFECTS.items()):
        version = version_of(ego_with(name))
        files = sorted(out.glob(f"{name}-{version}-*/{ANSWER}")) if defect.when else []
        runs = [Detection.model_validate_json(file.read_bytes()) for file in files]
        random = [run for run in runs if run.method == "random"]
        if not random:
            continue
        clean = [run for run in runs if run.method == UNDISTURBED]
        detected = sum(run.detected is not None for run in random)
        found = [(run.detected, run.method, run.seed) for run in runs if run.detected is not None]
        quickest = min(found, default=("", "", ""))
        yield (
            *(name, version, defect.families[0], defect.base, tier_of(detected, len(random)), int(defect.test_set)),
            *(len(random), detected, min(run.budget_steps for run in random)),
            *(sum(run.episodes for run in clean), sum(run.detected is not None for run in clean)),
            *(quickest[1], quickest[2], quickest[0]),
        )


def write(file: Path, columns: Sequence[str], lines: Sequence[tuple[object, ...]]) -> None:
    """Writes a table of rows below their columns."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([columns, *lines])
    replace_file(file, text.getvalue().encode())


def main() -> None:
    """Plays what is missing."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    broad = [name for name, defect in DEFECTS.items() if not defect.when]
    parser.add_argument("--defects", nargs="+", default=broad, choices=DEFECTS, metavar="NAME")
    parser.add_argument("--scenes", type=int, default=500, help="undisturbed ones (default: %(default)s)")
    parser.add_argument("--steps", type=int, default=60_000, help="of each search (default: %(default)s)")
    parser.add_argument("--seeds", type=int, default=1, help="of each search (default: %(default)s)")
    parser.add_argument("--tiers", action="store_true", help="write tiers.csv of what is in OUT; play nothing")
    options = parser.parse_args()
    if options.tiers:
        write(options.out / "tiers.csv", TIER_COLUMNS, list(tier_rows(options.out)))
        return
    admission_rows: list[tuple[object, ...]] = []
    for row in rows(options):
        admission_rows.append(row)
        write(options.out / "admission.csv", COLUMNS, admission_rows)


if __name__ == "__main__":
    main()
