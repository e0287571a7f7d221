"""Sweeps a folder of OpenSCENARIO variation files with several egos.

    python -m risk_sac.lab.figures.openscenario_sweeps FOLDER OUT [--only PATTERN ...] [--egos EGO ...] [--episodes N]

Plays what OUT lacks, shortest horizons first, and rewrites OUT/sweeps.csv after each cell of a scenario and an ego. A
grid of more than N points is sampled. An ego is `default`, a driver, or a driver and a defect such as
`idm-aeb+latency`. A file that cannot be imported is a row with its fault. `--markdown` prints the table of rows that
are there.
"""

import argparse
import csv
import json
from collections import Counter
from collections.abc import Sequence
from itertools import product
from pathlib import Path
from typing import NamedTuple

from risk_sac.config import Budget, RunSpec
from risk_sac.errors import ConfigError
from risk_sac.execution.evaluate import run
from risk_sac.lab.figures.pretrained_policy import ego_of
from risk_sac.lab.figures.shipped_scenarios import kept
from risk_sac.lab.figures.side_by_side import Row, write_rows
from risk_sac.openscenario.scenario_file import import_scenario
from risk_sac.records import EpisodeRecord, Outcome
from risk_sac.report.grid import StandardVerdict, played_grids
from risk_sac.run_folder.results import EPISODES, records_from_lines
from risk_sac.scenario import library
from risk_sac.scenario.families import family_named

VARIATION = b"<ParameterValueDistribution"
EGOS = ("default", "idm-aeb", "fiss-plus")
SEED = 59
COLUMNS = ("scenario", "entities", "varied", "grid", "unread", "points", "refused")


class Sweep(NamedTuple):
    """A scenario of the folder, as imported."""

    scenario: str  # path below the folder, without its suffix
    name: str  # in the library; empty if it cannot be imported
    entities: int = 0  # with the ego
    varied: int = 0  # parameters
    grid: int = 0  # points
    unread: int = 0  # remarks on what was not read
    fault: str = ""


class Cell(NamedTuple):
    """Key of a row."""

    sweep: Sweep
    ego: str


def variations(folder: Path, patterns: Sequence[str]) -> list[Path]:
    """Returns the folder's variation files whose path matches a pattern, in the order of their paths."""
    matching = {file for pattern in patterns for file in folder.rglob(f"{pattern}.xosc")}
    return sorted(file for file in matching if VARIATION in file.read_bytes())


def imported(file: Path, folder: Path) -> Sweep:
    """Imports a variation file and keeps it in the library."""
    scenario = str(file.relative_to(folder).with_suffix(""))
    try:
        scene = import_scenario(file)
        name = library.keep(scene.document, scene.files)
        varied = sum(parameter.value is None for parameter in scene.document.parameters.values())
        origin = scene.document.origin
        remarks = 0 if origin is None else len(origin.remarks)
        return Sweep(scenario, name, len(scene.document.actors) + 1, varied, scene.points, remarks)
    except ConfigError as error:
        return Sweep(scenario, "", fault=str(error))


def horizon(sweep: Sweep) -> int:
    """The longest episode of a scenario, steps."""
    return family_named(sweep.name).horizon_steps if sweep.name else 0


def play(out: Path, episodes: int, cell: Cell) -> Row:
    """Plays a sweep, or goes on with it, and returns its row."""
    about = {**cell.sweep._asdict(), "ego": cell.ego}
    if not cell.sweep.name:
        return about | outcomes([], [])
    folder = out / "runs" / f"{cell.sweep.name}-{cell.ego}-{episodes}"
    file = folder / "row.json"
    if file.exists():
        known: Row = json.loads(file.read_text())
        return known
    budget = Budget(episodes=min(episodes, max(cell.sweep.grid, 1)))
    spec = RunSpec(family=cell.sweep.name, method="story-sweep", seed=SEED, ego=ego_of(cell.ego), budget=budget)
    results = run(spec, folder, lambda episode, metrics: None)
    records = records_from_lines((folder / EPISODES).read_bytes())
    (grid,) = played_grids([folder])
    row = about | outcomes(records, [point.verdict for point in grid.points])
    if not results.finished:
        raise KeyboardInterrupt  # the same command goes on
    return kept(file, row | {"wall_s": round(results.wall_s)})


def outcomes(records: Sequence[EpisodeRecord], verdicts: Sequence[StandardVerdict]) -> Row:
    """Counts how episodes ended.

    `pass`, `contact`, `other` and `unjudged` are those that were played; `refused` tells by which rule the rest was.
    """
    refused = Counter(record.reason for record in records if record.outcome is Outcome.REJECTED)
    failures = [record for record in records if record.outcome is Outcome.FAILURE]
    contacts = [record for record in failures if record.collision is not None and record.collision.valid]
    kinds = Counter(record.worst_violation.kind for record in failures if record.worst_violation is not None)
    standard = Counter(verdicts)
    return {
        "points": len(records),
        "refused": " ".join(f"{rule}:{count}" for rule, count in refused.most_common()),
        "pass": sum(record.outcome is Outcome.SAFE for record in records),
        "contact": len(contacts),
        "other": len(failures) - len(contacts),
        "unjudged": standard[StandardVerdict.UNJUDGED],
        "r157_fail": standard[StandardVerdict.FAIL],
        "r157_out_of_scope": standard[StandardVerdict.OUT_OF_SCOPE],
        "kinds": " ".join(f"{kind}:{count}" for kind, count in kinds.most_common()),
        "steps": sum(record.steps for record in records),
        "wall_s": 0,
    }


def markdown(rows: Sequence[Row]) -> str:
    """Writes rows as the documents' table, a line per scenario, with a column for each ego.

    An ego's cell has passes, contacts and other failures; in brackets, contacts that R157's driver avoids.
    """
    egos = list(dict.fromkeys(row["ego"] for row in rows))
    by_scenario: dict[str, dict[str, Row]] = {}
    for row in rows:
        by_scenario.setdefault(row["scenario"], {})[row["ego"]] = row
    lines = ["| " + " | ".join((*COLUMNS, *egos)) + " |", "|---" * (len(COLUMNS) + len(egos)) + "|"]
    for scenario, of in sorted(by_scenario.items()):
        first = next(iter(of.values()))
        name = "/".join(Path(scenario).parts[-2:]).removesuffix("_variation")
        cells = [name, *(str(first[column]) or "–" for column in COLUMNS[1:])]
        cells += [_cell(of[ego]) if ego in of else "not played" for ego in egos]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def _cell(row: Row) -> str:
    if row["fault"]:
        return str(row["fault"])
    avoidable = f" ({row['r157_fail']})" if int(row["contact"]) else ""
    return f"{row['pass']}, {row['contact']}{avoidable}, {row['other']}"


def main() -> None:
    """Plays what is missing."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--only", nargs="+", metavar="PATTERN", default=["*"], help="of file names, without suffix")
    parser.add_argument("--egos", nargs="+", metavar="EGO", default=EGOS)
    parser.add_argument("--episodes", type=int, default=500, help="of each scenario and ego (default: %(default)s)")
    parser.add_argument("--markdown", action="store_true", help="play nothing, print the rows that are there")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    file = options.out / "sweeps.csv"
    if not options.markdown:
        sweeps = [imported(each, options.folder) for each in variations(options.folder, options.only)]
        cells = [Cell(sweep, ego) for ego, sweep in product(options.egos, sorted(sweeps, key=horizon))]
        rows: list[Row] = []
        for cell in cells:  # in this process, because loading the simulator takes longer than many cells
            rows.append(play(options.out, options.episodes, cell))
            write_rows(file, rows)
            print(*rows[-1].values(), sep=",", flush=True)
    with file.open(newline="") as lines:
        print(markdown(list(csv.DictReader(lines))))


if __name__ == "__main__":
    main()
