"""`python -m service.demo`: starts the service and searches for a planted defect."""

import argparse
import contextlib
import json
import os
import shlex
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from risk_sac.cli.campaigns.gate import GateBounds
from risk_sac.cli.campaigns.watch import driven_by_table, results_table, shown
from risk_sac.cli.console import headline
from risk_sac.client import Campaign, Client, ClientError, Episode, Results, Unreachable
from risk_sac.egos.defects.catalogue import DEFECTS
from risk_sac.host.terminal import console, run_command
from risk_sac.records import State
from risk_sac.run_folder.arrays import read_series
from risk_sac.run_folder.results import FAILURES, series_name
from service.settings import ServiceSettings

START_S = 60.0
STOP_S = 60.0
AWAY_S = 10.0  # short, since the service is not restarted
DEFECT, FAMILY = "latency", "mixed"  # the prior mostly finds it within the demo's budget, random search mostly does not


class DemoError(Exception):
    """The demo cannot go on; the message says why."""


def main(arguments: list[str] | None = None) -> int:
    """Runs the demo; exit status 0 with a valid failure, else 1."""
    options = _parser().parse_args(arguments)
    try:
        with _service(options.data_dir) as client:
            planted = f"planted defect: {options.defect}: {DEFECTS[options.defect].sentence}"
            console.print(planted, soft_wrap=True, markup=False)
            with shown() as show:
                campaign = client.wait(client.submit(_spec(options)).id, show, away_s=AWAY_S)
            failures = list(client.failures(campaign.id))
            results = client.results(campaign.id)
            _write(options.out, campaign, results, failures)
            console.print(results_table(results, GateBounds()))
            drove = driven_by_table(results)
            if drove is not None:
                console.print(drove)
            console.print(f"results: {options.out}")
            console.print(f"recorded failures: {options.data_dir}/campaigns/{campaign.id}", soft_wrap=True)
            first = first_detections(campaign, failures, options.data_dir)
            if failures:
                command = draw_command(campaign, list(filter(None, first.values())) or failures, options.data_dir)
                console.print(f"draw one: {command}", soft_wrap=True, markup=False)
            page = f"page/#/campaigns/{campaign.id}"
            if not options.keep:
                serve = f"RISK_SAC_DATA_DIR={shlex.quote(str(options.data_dir))} make serve"
                place = f"http://127.0.0.1:8000/{page}"
                console.print(f"look at all: {serve}, then {place}", soft_wrap=True, markup=False)
            status = conclude(campaign)
            console.print(in_words(options.defect, campaign, first), soft_wrap=True, markup=False)
            if options.keep:
                console.print(f"look at all: {client.url}/{page} (Ctrl+C ends it)", soft_wrap=True, markup=False)
                with contextlib.suppress(KeyboardInterrupt):
                    signal.pause()
            return status
    except (DemoError, ClientError) as error:
        console.print(f"demo failed: {error}", style="bold red", markup=False)
        return 1


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m service.demo", description=__doc__)
    parser.add_argument("--defect", default=DEFECT, choices=DEFECTS, metavar="NAME", help="that the ego has")
    parser.add_argument(
        "--scenario",
        dest="family",
        help=f"scenario family (default: {FAMILY}, or the first in which another defect matters)",
    )
    parser.add_argument(
        "--methods", nargs="+", default=["risk-sac-diverse", "random"], help="search methods, side by side"
    )
    parser.add_argument("--episodes", type=int, default=200, help="search episodes of each run")
    parser.add_argument("--seeds", type=int, nargs="+", default=[0], help="one run per method and seed")
    parser.add_argument("--out", type=Path, default=Path("results/demo.json"), help="where the results go")
    parser.add_argument(
        "--data-dir",
        type=Path,
        default=Path("results") / time.strftime("demo-%Y%m%d-%H%M%S"),
        help="where the service keeps its database and the recorded failures",
    )
    parser.add_argument("--keep", action="store_true", help="go on serving the page at the end")
    return parser


def _spec(options: argparse.Namespace) -> dict[str, object]:
    defect = DEFECTS[options.defect]
    return {
        "label": f"demo: {options.defect}",
        "families": [options.family or (FAMILY if options.defect == DEFECT else defect.families[0])],
        "methods": options.methods,
        "seeds": options.seeds,
        "ego": ({} if defect.base == "default" else {"driver": defect.base}) | {"defects": [defect.name]},
        "budget": {"episodes": options.episodes},
    }


@contextlib.contextmanager
def _service(data_dir: Path) -> Iterator[Client]:
    """Runs the service on a free loopback port; yields its client."""
    with socket.create_server(("127.0.0.1", 0)) as probe:
        port = probe.getsockname()[1]
    data_dir.mkdir(mode=0o700, parents=True, exist_ok=True)  # the mode that the service asks for
    log = data_dir / "service.log"
    settings = {"RISK_SAC_HOST": "127.0.0.1", "RISK_SAC_PORT": str(port), "RISK_SAC_DATA_DIR": str(data_dir)}
    with log.open("wb") as stream:
        command = [sys.executable, "-m", "risk_sac", "serve"]
        process = subprocess.Popen(command, env=os.environ | settings, stdout=stream, stderr=stream)
    try:
        with Client(f"http://127.0.0.1:{port}") as client:
            _wait_until_up(client.url, process, log)
            console.print(f"service: {client.url} (log: {log})")
            yield client
    finally:
        process.terminate()
        try:
            process.wait(STOP_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def _wait_until_up(url: str, process: subprocess.Popen[bytes], log: Path) -> None:
    deadline = time.monotonic() + START_S
    with Client(url, patience_s=0) as client:
        while time.monotonic() < deadline:
            if process.poll() is not None:
                raise DemoError(f"the service ended with status {process.returncode}; its log is {log}")
            try:
                next(client.campaigns(), None)
            except Unreachable:
                time.sleep(0.1)
            else:
                return
    raise DemoError(f"the service did not answer within {START_S:g} s; its log is {log}")


def _write(out: Path, campaign: Campaign, results: Results, failures: Sequence[Episode]) -> None:
    document = {
        "campaign": campaign.model_dump(mode="json"),
        "results": results.model_dump(mode="json"),
        "failures": [
            failure.model_dump(mode="json") | {"series": _series(campaign.id, failure)} for failure in failures
        ],
    }
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text(json.dumps(document, indent=2, allow_nan=False) + "\n", encoding="utf-8")


def first_detections(campaign: Campaign, failures: Sequence[Episode], data_dir: Path) -> Mapping[str, Episode | None]:
    """Returns each search's first failure that detects the defect, by run id."""
    from risk_sac.failures.play import detected  # here, because loading the simulator takes seconds

    detections: dict[str, Episode | None] = {}
    for spec in campaign.spec.searches():
        folder = ServiceSettings(data_dir=data_dir).run_folder(campaign.id, spec.id) / FAILURES
        of_run = sorted((each for each in failures if each.run_id == spec.id), key=lambda each: each.index)
        detections[spec.id] = next(
            (each for each in of_run if detected(spec, each, read_series(folder / series_name(each.index)))), None
        )
    return detections


def in_words(defect: str, campaign: Campaign, first: Mapping[str, Episode | None]) -> str:
    """Says after how many episodes each search has found the defect."""
    budget = campaign.spec.budget.episodes
    several = len(campaign.spec.seeds) > 1
    parts = []
    for spec in campaign.spec.searches():
        failure = first[spec.id]
        name = f"{spec.method}, seed {spec.seed}" if several else spec.method
        after = f"not within its {budget} episodes" if failure is None else f"after {failure.index + 1} episodes"
        parts.append(f"{after} by {name}")
    return f"the defect `{defect}` was found {'; '.join(parts)}"


def _series(campaign_id: str, failure: Episode) -> str:
    settings = ServiceSettings()
    folder = settings.run_folder(campaign_id, failure.run_id).relative_to(settings.data_dir)
    return (folder / FAILURES / series_name(failure.index)).as_posix()


def draw_command(campaign: Campaign, failures: Sequence[Episode], data_dir: Path) -> str:
    """Returns the command that draws the best-ranked failure, the earliest of ties."""
    order = [run.id for run in campaign.runs]
    first = min(failures, key=lambda each: (*_rank(each), order.index(each.run_id)))
    program, here = Path(sys.executable).with_name("risk-sac"), Path.cwd()
    program = program.relative_to(here) if program.is_relative_to(here) else program
    folder = ServiceSettings(data_dir=data_dir).run_folder(campaign.id, first.run_id)
    return shlex.join(map(str, (program, "show", folder, first.id, "--out", data_dir / "failure.png")))


def _rank(failure: Episode) -> tuple[bool, bool]:
    """Returns a sort key: headline candidates first, then preventable failures."""
    valid = failure.valid_violations
    return not any(each.headline_candidate for each in valid), not any(each.preventable for each in valid)


def conclude(campaign: Campaign) -> int:
    """Prints how many failures were found; returns the exit status."""
    progress = campaign.progress
    if campaign.state is not State.SUCCEEDED:
        console.print(f"campaign {campaign.state}: {campaign.reason}", style="bold red", markup=False)
        return 1
    if progress.distinct_failures == 0:
        console.print("no valid failure was found; try more --episodes or another --seeds", style="bold red")
        return 1
    found = headline(progress.headline, progress.headline_candidates, progress.headline_published)
    of = f"of {progress.distinct_failures} distinct ones, {progress.distinct_preventable} preventable"
    of += f"; {progress.implausible} implausible" if progress.implausible else ""
    console.print(f"headline failures: {found} ({of})", style="bold green")
    return 0


if __name__ == "__main__":
    sys.exit(run_command(main))
