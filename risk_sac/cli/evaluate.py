"""`risk-sac evaluate`: methods compared over seeds without a server."""

import argparse
import os
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from risk_sac.cli.campaign_flags import add_campaign_flags, add_ego_flag, campaign_flags, ego_flag
from risk_sac.cli.console import FAILED, INTERRUPTED, OK, Board, Commands, complain, console, progress_bar
from risk_sac.cli.on_map import add_map_flags, families_on_map
from risk_sac.cli.text import counted
from risk_sac.config import METHODS, SHIPPED
from risk_sac.config.spec_file import read_campaign
from risk_sac.run_folder.verified import TIMES

if TYPE_CHECKING:
    from risk_sac.execution.processes import Job

SEEDS = 5  # of a comparison that names none


def add_evaluate(commands: Commands) -> None:
    """Adds the command."""
    evaluate = commands.add_parser(
        "evaluate", help="compare methods over seeds, with tables and figures; the same command again goes on with it"
    )
    evaluate.set_defaults(command=_evaluate)
    add_map_flags(evaluate, several=True)
    add_campaign_flags(evaluate, families="all", methods="all", seeds=SEEDS)
    add_ego_flag(evaluate)
    evaluate.add_argument(
        "--jobs",
        type=int,
        metavar="N",
        help="runs at a time (default: one per core, or what a cluster has room for)",
    )
    evaluate.add_argument(
        "--executor",
        default=os.environ.get("RISK_SAC_EXECUTOR", "local"),
        metavar="NAME",
        help="where runs execute: `local` or, on a cluster, `ray` (default: RISK_SAC_EXECUTOR or local)",
    )
    evaluate.add_argument(
        "--verify",
        type=int,
        default=TIMES,
        metavar="N",
        help=f"how often each distinct failure is replayed (default: {TIMES})",
    )
    evaluate.add_argument("--out", type=Path, required=True, metavar="DIR", help="folder of runs, tables and figures")


def _evaluate(options: argparse.Namespace) -> int:
    methods = [name for name, method in METHODS.items() if not method.needs]
    defaults = {"families": SHIPPED, "methods": methods, "seeds": range(SEEDS)}
    defaults = {name: list(values) for name, values in defaults.items()}
    options.families = families_on_map(options) or options.families
    spec = read_campaign(options.spec, campaign_flags(options, SEEDS) | ego_flag(options), defaults)
    from risk_sac.execution.evaluate import evaluate  # here, because loading what checks the settings takes seconds

    with progress_bar() as bar:
        fill = os.cpu_count() or 1 if options.executor == "local" else len(spec.runs())
        jobs = options.jobs if options.jobs is not None else fill
        progress = partial(drawn, Board(bar))
        evaluation = evaluate(spec, options.out, options.typed, jobs, progress, options.executor, options.verify)
    for job in evaluation.failed:
        complain(f"{job.name}: {job.reason}")
    comparison = evaluation.comparison
    runs = f"{len(comparison.runs)} of {counted(len(comparison.runs) + len(comparison.missing), 'run')}"
    console.print(f"Report of {runs}: {options.out}/table.md, table.json, table.csv, figures/", soft_wrap=True)
    if evaluation.stopped:
        console.print("Stopped. The same command again goes on from there.")
        return INTERRUPTED
    return FAILED if comparison.missing else OK


def drawn(board: Board, jobs: "Sequence[Job]") -> None:
    """Draws how runs go."""
    done = {job.name: job.total if job.state == "finished" else job.done() for job in jobs}
    finished = sum(job.state == "finished" for job in jobs)
    failed = sum(job.state == "failed" for job in jobs)
    found = f"{finished}/{counted(len(jobs), 'run')}" + (f", {failed} failed" if failed else "")
    at_work = {job.name: (done[job.name], job.total) for job in jobs if job.state == "running"}
    board.show(sum(done.values()), sum(job.total for job in jobs), found, at_work)
