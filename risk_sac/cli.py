"""`risk-sac`: one run without a server, pictures of what it found, and the server itself."""

import argparse
import os
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

from risk_sac.config import METHODS, RunSpec
from risk_sac.errors import ConfigError, RiskSacError
from risk_sac.results import Results, read_results
from risk_sac.spec_file import read_spec
from risk_sac.types import RunMetrics

OK, FAILED, MISUSED, INTERRUPTED = 0, 1, 2, 130
console = Console(highlight=False)
errors = Console(stderr=True, highlight=False, soft_wrap=True)


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs one command; returns the exit status."""
    options = _parser().parse_args(arguments)
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
    table = Table("", *columns, title=f"{spec.family} · {spec.method} · seed {spec.seed} · {results.wall_s:.0f} s")
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
