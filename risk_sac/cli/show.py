"""`risk-sac show`: the failures of a run, refused ones included, and pictures of them."""

import argparse
import textwrap
from collections.abc import Sequence
from pathlib import Path

from rich.table import Table

from risk_sac.cli.console import (
    EGO,
    OK,
    OUTCOME,
    Commands,
    add_command,
    driven_by_in_words,
    headline,
    in_words,
    narrow_table,
    offences,
    outcome,
)
from risk_sac.config.spec_file import read_ego
from risk_sac.failures.question import IDLE
from risk_sac.failures.recording import Recording
from risk_sac.metrics import headline_driven_by
from risk_sac.records import Collision, Judgement, RunMetrics, Violation
from risk_sac.run_folder.results import Results, read_results
from risk_sac.run_folder.series import read_series
from risk_sac.terminal import console

NAME_WIDTH = 20  # of a requirement's name in the list


def add(commands: Commands) -> None:
    """Add the command."""
    show = add_command(commands, "show", _show, "list a run's failures, or draw one")
    show.add_argument("results", type=Path, metavar="RESULTS", help="folder of a run, or its results.json")
    show.add_argument(
        "failure", nargs="?", metavar="FAILURE", help="id of a failure, or its number; default: list them"
    )
    twin = f"draw beside it the same scene without an attack (idle), or with this ego: {EGO}"
    show.add_argument("--twin", metavar="TWIN", help=twin)
    show.add_argument("--out", type=Path, metavar="FILE.png", help="(default: failures/FAILURE.png beside RESULTS)")


def _show(options: argparse.Namespace) -> int:
    results = read_results(options.results)
    if options.failure is None:
        for phase in (results.metrics, results.evaluation):
            if phase is not None:
                name = "headline failures" if phase is results.metrics else "headline failures of the evaluation"
                console.print(f"{name}: {headline(phase.headline, phase.headline_candidates)}{_driven_by([phase])}")
                console.print(f"episodes driven by: {driven_by_in_words(phase.episodes_driven_by)}")
        console.print(_failures(results))
        return OK
    failure = results.failure(options.failure)
    folder = options.results if options.results.is_dir() else options.results.parent
    from risk_sac.failures.show import draw  # here, because loading matplotlib takes a second

    recording = Recording(failure, read_series(folder / failure.series))
    twin = None
    if options.twin is not None:
        from risk_sac.failures.play import twin_recording

        ego = None if options.twin == IDLE else read_ego(options.twin)
        twin = twin_recording(results.spec, recording, ego, options.twin)
    stem = Path(failure.series).stem + ("" if options.twin is None else f"-{Path(options.twin).stem}")
    picture = options.out or (folder / failure.series).with_name(f"{stem}.png")
    draw(results.spec.family, recording, picture, twin)
    console.print(f"Drawn: {picture}", soft_wrap=True)
    return OK


def _driven_by(phases: Sequence[RunMetrics]) -> str:
    """What drove the headline failures, in brackets; empty without any."""
    counts = headline_driven_by(phases)
    return f" (driven by: {driven_by_in_words(counts)})" if counts else ""


def _failures(results: Results) -> Table:
    """Two lines per failure, under the id of the run, with which their own ids begin.

    Fits 80 columns; only the last one wraps.
    """
    run = results.spec.id
    table = narrow_table(
        "id",
        OUTCOME,
        "other",
        "speed\nof ego,\nother,\nm/s",
        "ego's\nother's\nzone",
        "requirement, or\nconflict; began\nat s, x y m",
        "failed rules,\nor offences",
        title=run,
        caption=f"in full, as the service says it: {run}-ID",
    )
    for failure in results.failures:
        violation = failure.episode.worst_violation
        if violation is None:
            continue
        cells = _of_contact(violation) if isinstance(violation, Collision) else _without_contact(violation)
        reason = failure.episode.reason
        table.add_row(
            failure.id.removeprefix(f"{run}-"),
            outcome(failure.episode, violation),
            violation.other_id or "",
            *cells,
            in_words([reason]) if reason else "\n".join(offences(violation)),
        )
    return table


def _of_contact(collision: Collision) -> tuple[str, ...]:
    """Speeds, zones, and how the conflict began."""
    return (
        f"{collision.ego_speed_mps:.1f}\n{collision.other_speed_mps:.1f}",
        f"{collision.ego_zone}\n{collision.other_zone}",
        "" if collision.judgement is None else _conflict(collision.judgement),
    )


def _without_contact(violation: Violation) -> tuple[str, ...]:
    """The same of a violation without contact, which has no zones."""
    name = textwrap.fill(violation.requirement, NAME_WIDTH)
    return f"{violation.ego_speed_mps:.1f}", "", f"{name}\n{violation.time_s:.1f}"


def _conflict(judgement: Judgement) -> str:
    """How it began, and when after the release and where on the map."""
    began = f"{judgement.conflict_s:.1f}, {judgement.conflict_x_m:.0f} {judgement.conflict_y_m:.0f}"
    return f"{judgement.conflict_type.replace('_', ' ')}\n{began}"
