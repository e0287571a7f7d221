"""`risk-sac`: one run or a comparison of methods without a server, pictures of failures, and the server itself."""

import argparse
import os
import shlex
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

from risk_sac.config import METHODS, FamilyName, RunSpec
from risk_sac.errors import ConfigError, RiskSacError
from risk_sac.results import Results, read_results
from risk_sac.spec_file import read_campaign, read_spec
from risk_sac.types import RunMetrics

if TYPE_CHECKING:
    from risk_sac.processes import Job

OK, FAILED, MISUSED, INTERRUPTED = 0, 1, 2, 130
SEEDS = 5  # of a comparison that names none
console = Console(highlight=False)
errors = Console(stderr=True, highlight=False, soft_wrap=True)


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs one command; returns the exit status."""
    options = _parser().parse_args(arguments)
    options.typed = shlex.join(["risk-sac", *(sys.argv[1:] if arguments is None else arguments)])
    try:
        status: int = options.command(options)
    except ConfigError as error:
        _complain(f"{error.field}: {error}" if error.field else str(error))
        return MISUSED
    except (RiskSacError, OSError) as error:
        _complain(str(error))
        return FAILED
    except KeyboardInterrupt:
        _complain("interrupted")
        return INTERRUPTED
    return status


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="risk-sac", description="Finds scenes and adversaries that make an ego crash."
    )
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    run = commands.add_parser("run", help="one run without a server; the same command again goes on with it")
    run.set_defaults(command=_run)
    run.add_argument("--family", metavar="low|mixed|dense", help="scenario family")
    run.add_argument("--method", metavar="NAME", help=f"one of {', '.join(METHODS)} (default: risk-sac)")
    run.add_argument("--episodes", type=int, metavar="N", help="search episodes (default: 300)")
    run.add_argument("--evaluation-episodes", type=int, metavar="N", help="episodes of the frozen policy (default: 0)")
    run.add_argument("--seed", type=int, metavar="S", help="(default: 0)")
    run.add_argument("--spec", type=Path, metavar="FILE.yaml", help="settings of a run or campaign; flags go first")
    run.add_argument("--out", type=Path, required=True, metavar="DIR", help="folder of the results")
    evaluate = commands.add_parser(
        "evaluate", help="compare methods over seeds, with tables and figures; the same command again goes on with it"
    )
    evaluate.set_defaults(command=_evaluate)
    evaluate.add_argument("--families", nargs="+", metavar="low|mixed|dense", help="(default: all)")
    evaluate.add_argument("--methods", nargs="+", metavar="NAME", help=f"of {', '.join(METHODS)} (default: all)")
    evaluate.add_argument("--seeds", type=int, metavar="N", help=f"how many (default: {SEEDS})")
    evaluate.add_argument("--first-seed", type=int, metavar="S", help="the N seeds begin here (default: 0)")
    evaluate.add_argument("--episodes", type=int, metavar="N", help="search episodes of each run (default: 300)")
    evaluate.add_argument(
        "--evaluation-episodes", type=int, metavar="N", help="episodes of the frozen policy (default: 0)"
    )
    evaluate.add_argument("--spec", type=Path, metavar="FILE.yaml", help="settings of a campaign; flags go first")
    evaluate.add_argument("--jobs", type=int, metavar="N", help="runs at a time (default: one per core)")
    evaluate.add_argument("--out", type=Path, required=True, metavar="DIR", help="folder of runs, tables and figures")
    show = commands.add_parser("show", help="list a run's contacts, or draw one")
    show.set_defaults(command=_show)
    show.add_argument("results", type=Path, metavar="RESULTS", help="folder of a run, or its results.json")
    show.add_argument("failure", nargs="?", metavar="FAILURE", help="id of a contact; without it they are listed")
    show.add_argument("--out", type=Path, metavar="FILE.png", help="(default: failures/FAILURE.png beside RESULTS)")
    serve = commands.add_parser("serve", help="run the service in the foreground")
    serve.set_defaults(command=_serve)
    serve.add_argument("--host", metavar="ADDRESS", help="(default: 127.0.0.1)")
    serve.add_argument("--port", type=int, help="(default: 8000)")
    serve.add_argument("--data-dir", type=Path, metavar="DIR", help="(default: data)")
    return parser


def _run(options: argparse.Namespace) -> int:
    names = ("family", "method", "seed", "episodes", "evaluation_episodes")
    spec = read_spec(options.spec, {name: getattr(options, name) for name in names})
    from risk_sac.local_run import run  # here, because loading torch takes seconds

    total = spec.budget.episodes + spec.budget.evaluation_episodes
    with _progress_bar() as bar:
        task = bar.add_task(f"{spec.family} {spec.method}", total=total, found="")

        def advance(done: int, metrics: RunMetrics | None) -> None:
            bar.update(task, completed=done, found=_found(metrics))

        results = run(spec, options.out, advance)
    if not results.finished:
        done = (results.metrics.episodes if results.metrics else 0) + (
            results.evaluation.episodes if results.evaluation else 0
        )
        console.print(f"Stopped after {done} of {total} episodes. The same command again goes on from there.")
        return INTERRUPTED
    console.print(_summary(spec, results))
    console.print(f"Results: {options.out}/results.json")
    return OK


def _evaluate(options: argparse.Namespace) -> int:
    flags = {name: getattr(options, name) for name in ("families", "methods", "episodes", "evaluation_episodes")}
    defaults = {"families": get_args(FamilyName), "methods": tuple(METHODS), "seeds": range(SEEDS)}
    defaults = {name: list(values) for name, values in defaults.items()}
    spec = read_campaign(options.spec, flags | {"seeds": _seeds(options)}, defaults)
    from risk_sac.evaluate import evaluate  # here, because loading what checks the settings takes seconds

    with _progress_bar() as bar:
        jobs = options.jobs if options.jobs is not None else os.cpu_count() or 1
        evaluation = evaluate(spec, options.out, options.typed, jobs, _Board(bar))
    for job in evaluation.failed:
        _complain(f"{job.name}: {job.reason}")
    comparison = evaluation.comparison
    runs = f"{len(comparison.runs)} of {len(comparison.runs) + len(comparison.missing)} runs"
    console.print(f"Report of {runs}: {options.out}/table.md, table.json, table.csv, figures/", soft_wrap=True)
    if evaluation.stopped:
        console.print("Stopped. The same command again goes on from there.")
        return INTERRUPTED
    return FAILED if comparison.missing else OK


def _seeds(options: argparse.Namespace) -> list[int] | None:
    """The seeds that flags ask for; None where they ask for none."""
    if options.seeds is None and options.first_seed is None:
        return None
    count = SEEDS if options.seeds is None else options.seeds
    if not 1 <= count <= 100:
        raise ConfigError(f"got {count}; wanted 1 to 100 seeds", field="seeds")
    first = options.first_seed or 0
    return list(range(first, first + count))


class _Board:
    """One bar for the campaign, and one for each run at work."""

    def __init__(self, bar: Progress) -> None:
        self._bar = bar
        self._all = bar.add_task("all runs", total=None, found="")
        self._tasks: dict[str, Any] = {}

    def __call__(self, jobs: "Sequence[Job]") -> None:
        """Draws the present state."""
        done = {job.name: job.total if job.state == "finished" else job.done() for job in jobs}
        finished = sum(job.state == "finished" for job in jobs)
        failed = sum(job.state == "failed" for job in jobs)
        found = f"{finished}/{len(jobs)} runs" + (f", {failed} failed" if failed else "")
        self._bar.update(self._all, completed=sum(done.values()), total=sum(job.total for job in jobs), found=found)
        for job in jobs:
            if job.state == "running" and job.name not in self._tasks:
                self._tasks[job.name] = self._bar.add_task(job.name, total=job.total, found="")
            elif job.state != "running" and job.name in self._tasks:
                self._bar.remove_task(self._tasks.pop(job.name))
        for name, task in self._tasks.items():
            self._bar.update(task, completed=done[name])


def _show(options: argparse.Namespace) -> int:
    results = read_results(options.results)
    if options.failure is None:
        console.print(_contacts(results))
        return OK
    contact = results.contact(options.failure)
    folder = options.results if options.results.is_dir() else options.results.parent
    from risk_sac.show import draw  # here, because loading matplotlib takes a second

    picture = options.out or (folder / contact.series).with_suffix(".png")
    draw(results.spec.family, contact, folder, picture)
    console.print(f"Drawn: {picture}")
    return OK


def _serve(options: argparse.Namespace) -> int:
    """Replaces this process: the method's code never imports the service."""
    given = {"HOST": options.host, "PORT": options.port, "DATA_DIR": options.data_dir}
    settings = {f"RISK_SAC_{name}": str(value) for name, value in given.items() if value is not None}
    os.execve(sys.executable, [sys.executable, "-m", "service"], os.environ | settings)


def _complain(message: str) -> None:
    errors.print(message, style="red", markup=False)


def _progress_bar() -> Progress:
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[found]}"),
        TimeRemainingColumn(),
        console=console,
    )


def _found(metrics: RunMetrics | None) -> str:
    if metrics is None:
        return ""
    return (
        f"failures {metrics.failures}  contacts {metrics.raw_collisions}  "
        f"window ECR {metrics.window_ecr:.2f}  λ {metrics.dual_variable:.3f}"
    )


def _summary(spec: RunSpec, results: Results) -> Table:
    """One column per phase."""
    phases = {"search": results.metrics, "evaluation": results.evaluation}
    columns = {name: _figures(metrics) for name, metrics in phases.items() if metrics is not None}
    title = f"{spec.family} · {spec.method} · seed {spec.seed} · {results.wall_s:.0f} s on {results.device}"
    table = Table("", *columns, title=title)
    for figure in next(iter(columns.values()), {}):
        table.add_row(figure, *(column[figure] for column in columns.values()))
    return table


def _figures(metrics: RunMetrics) -> dict[str, str]:
    values = asdict(metrics)
    return {
        "episodes": f"{metrics.episodes} ({metrics.rejected} rejected)",
        "contacts": f"{metrics.raw_collisions}",
        "valid failures": f"{metrics.failures}",
        "ECR (95 %)": "{ecr:.3f} ({ecr_low:.3f} to {ecr_high:.3f})".format(**values),
        "efficiency ES": f"{metrics.efficiency:.3f}",
        "realism cost per step": f"{metrics.cost_rate:.3f}",
        "dispersion OFD": _or_dash(metrics.dispersion, ".3f"),
        "distinct failures": f"{metrics.distinct_failures}",
        "steps per distinct failure": _or_dash(metrics.steps_per_distinct_failure, ".0f"),
    }


def _contacts(results: Results) -> Table:
    """Fits 80 columns; only the failed rules wrap."""
    table = Table(box=SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for name in ("id", "outcome", "other", "ego\nm/s", "other\nm/s", "ego's zone\non other's", "TTC\ns", "seen\ns"):
        table.add_column(name, no_wrap=True)
    table.add_column("failed rules")
    for contact in results.contacts:
        collision = contact.episode.collision
        if collision is None:
            continue
        table.add_row(
            contact.id,
            contact.episode.outcome,
            collision.other_id,
            f"{collision.ego_speed_mps:.1f}",
            f"{collision.other_speed_mps:.1f}",
            f"{collision.ego_zone} {collision.other_zone}",
            f"{collision.min_ttc_s:.2f}",
            f"{collision.visible_for_s:.1f}",
            contact.episode.reason,
        )
    return table


def _or_dash(value: float | None, format_: str) -> str:
    return "-" if value is None else format(value, format_)
