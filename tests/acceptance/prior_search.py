"""Finds of searches with and without the prior, at equal steps.

    python -m tests.acceptance.prior_search OUT --egos fiss-plus [--scenario low mixed dense] [--seeds 3] [--steps 5000]
    python -m tests.acceptance.prior_search OUT --egos idm-aeb --town

plays what OUT lacks, and rewrites OUT/searches.csv after each run.
"""

import argparse
import tempfile
from collections import Counter
from functools import partial
from itertools import product
from pathlib import Path
from typing import NamedTuple

from risk_sac.config import Budget, EgoConfig, RunMethod, RunSpec
from risk_sac.egos.registry import pinned
from risk_sac.execution.recorder import Recorder
from risk_sac.lab.figures.planner_table import spent
from risk_sac.lab.figures.regression_prior import Until
from risk_sac.lab.figures.side_by_side import Row, rows_of
from risk_sac.maps.convert import present_net
from risk_sac.maps.finder import Map
from risk_sac.records import EpisodeRecord
from risk_sac.run_folder.results import EPISODES, records_from_lines
from risk_sac.scenario.reading import PAPER_FAMILIES
from risk_sac.search.loop import execute_run
from risk_sac.verdicts.distinct import variant_name
from tests.maps import osm_town

# Of each pattern a place of 50 km/h with the most adversaries, chosen before the first run.
TOWN = ("car_following_minus_2_0_", "crossing_7_3_", "junction_minus_2_1_")
ARMS: tuple[tuple[RunMethod, str], ...] = (
    ("risk-sac-diverse", "shipped"),
    ("risk-sac-diverse", "none"),
    ("archive-replay", "shipped"),
    ("archive", "shipped"),
    ("random", "shipped"),
)
MOST_EPISODES = 3000


class Search(NamedTuple):
    """One run."""

    family: str
    ego: str
    method: RunMethod
    prior: str
    seed: int


def town() -> list[str]:
    """Puts the town's places into the library; returns their names."""
    with tempfile.TemporaryDirectory() as folder:
        extract = Path(folder, "town.osm")
        extract.write_text(osm_town())
        found = Map(present_net(extract, Path(folder)).file)
        names = [
            found.keep(fit)
            for pattern in ("car_following", "crossing", "junction")
            for fit in found.fits(pattern, None)
        ]
    return [next(name for name in names if name.startswith(wanted)) for wanted in TOWN]


def play(steps: int, out: Path, search: Search) -> Row:
    """Plays or continues a run up to `steps`; returns what it found."""
    folder = out / "-".join(map(str, search))
    if not spent(folder, steps):
        ego = pinned(EgoConfig() if search.ego == "default" else EgoConfig(driver=search.ego))
        spec = RunSpec(
            family=search.family,
            method=search.method,
            seed=search.seed,
            prior=search.prior,
            ego=ego,
            budget=Budget(episodes=MOST_EPISODES),
        )
        recorder = Recorder(spec, folder, Until(steps))
        recorder.finish(execute_run(spec, folder, recorder))
    return search._asdict() | row(records_from_lines((folder / EPISODES).read_bytes()))


def row(records: list[EpisodeRecord]) -> Row:
    """Returns the figures of a run's episodes."""
    found = [each for record in records for each in record.valid_violations]
    drove = Counter(str(record.driven_by) for record in records)
    failed = Counter(str(record.driven_by) for record in records if record.valid_violations)
    return {
        "episodes": len(records),
        "steps": sum(record.steps for record in records),
        "valid": len(found),
        "distinct": len({variant_name(each) for each in found}),
        "preventable_distinct": len({variant_name(each) for each in found if each.preventable}),
        "candidates_distinct": len({variant_name(each) for each in found if each.headline_candidate}),
        **{f"{driver}_episodes": drove[driver] for driver in ("policy", "model", "script", "random")},
        **{f"{driver}_failures": failed[driver] for driver in ("policy", "model", "script", "random")},
    }


def main() -> None:
    """Plays what is missing."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--egos", nargs="+", required=True, metavar="EGO")
    parser.add_argument("--scenario", dest="families", nargs="+", choices=PAPER_FAMILIES, default=list(PAPER_FAMILIES))
    parser.add_argument("--town", action="store_true", help="at places of the town instead of at families")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--steps", type=int, default=5000)
    parser.add_argument("--jobs", type=int, default=2)
    options = parser.parse_args()
    families = town() if options.town else options.families
    seeds = range(1, options.seeds + 1)
    wanted = [Search(f, e, *arm, s) for s, e, f, arm in product(seeds, options.egos, families, ARMS)]
    rows_of(partial(play, options.steps, options.out), wanted, options.jobs, options.out / "searches.csv")


if __name__ == "__main__":
    main()
