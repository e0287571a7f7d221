"""`python -m service.demo`: start the service, let RISK-SAC and an archive search work together, say what it found."""

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
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn
from rich.table import Table

from risk_sac.client import Campaign, Client, ClientError, Unreachable
from risk_sac.records import Grade
from risk_sac.run_folder.results import FAILURES, series_name
from service.settings import ServiceSettings

START_S = 60.0
STOP_S = 60.0
AWAY_S = 10.0  # nobody starts it again
# README has a line for each.
COLUMNS = ("method", "epi-\nsodes", "con-\ntacts", "valid", "distinct", "preven-\ntable", "ECR", "PCR", "PCR's\n95 %")

Json = dict[str, Any]


class DemoError(Exception):
    """The demo cannot go on; the message says why."""


def main(arguments: list[str] | None = None) -> int:
    """Run the demo; returns the exit status: 0 with a valid failure found, 1 without."""
    options = _parser().parse_args(arguments)
    console = Console()
    try:
        with _service(options.data_dir, console) as client:
            campaign = _follow(client, client.submit(_spec(options)).id, console)
            found = _collect(client, campaign)
            status = _tell(found, options, console)
            if options.keep:
                _keep(f"{client.url}/page/#/campaigns/{campaign.id}", console)
            return status
    except (DemoError, ClientError) as error:
        console.print(f"demo failed: {error}", style="bold red", markup=False)
        return 1


def _tell(found: Json, options: argparse.Namespace, console: Console) -> int:
    """Writes and prints what was found, and where to look at it; returns the exit status."""
    campaign_id, data_dir = found["campaign"]["id"], options.data_dir
    options.out.parent.mkdir(parents=True, exist_ok=True)
    options.out.write_text(json.dumps(found, indent=2, allow_nan=False) + "\n", encoding="utf-8")
    _summarise(found, console)
    console.print(f"results: {options.out}")
    console.print(f"recorded failures: {data_dir}/campaigns/{campaign_id}", soft_wrap=True)
    _invite(found, data_dir, console)
    if not options.keep:
        serve = f"RISK_SAC_DATA_DIR={shlex.quote(str(data_dir))} make serve"
        place = f"http://127.0.0.1:8000/page/#/campaigns/{campaign_id}"
        console.print(f"look at all: {serve}, then {place}", soft_wrap=True, markup=False, highlight=False)
    return _verdict(found, console)


def _keep(page: str, console: Console) -> None:
    """Goes on serving until somebody has seen enough."""
    console.print(f"look at all: {page} (Ctrl+C ends it)", soft_wrap=True, markup=False, highlight=False)
    with contextlib.suppress(KeyboardInterrupt):
        signal.pause()


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m service.demo", description=__doc__)
    parser.add_argument("--family", default="low", help="scenario family")
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


@contextlib.contextmanager
def _service(data_dir: Path, console: Console) -> Iterator[Client]:
    """A client of the service on a free loopback port, which is stopped at the end."""
    with socket.create_server(("127.0.0.1", 0)) as probe:
        port = probe.getsockname()[1]
    data_dir.mkdir(mode=0o700, parents=True, exist_ok=True)  # as the service wants it, which comes after the log
    log = data_dir / "service.log"
    environment = os.environ | {
        "RISK_SAC_HOST": "127.0.0.1",
        "RISK_SAC_PORT": str(port),
        "RISK_SAC_DATA_DIR": str(data_dir),
    }
    with log.open("wb") as stream:
        process = subprocess.Popen(
            [sys.executable, "-m", "risk_sac", "serve"], env=environment, stdout=stream, stderr=stream
        )
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


def _spec(options: argparse.Namespace) -> Json:
    return {
        "label": "demo",
        "families": [options.family],
        "methods": options.methods,
        "seeds": options.seeds,
        "budget": {"episodes": options.episodes},
    }


def _follow(client: Client, campaign_id: str, console: Console) -> Campaign:
    """The campaign once it has ended, with a bar that moves until then."""
    columns = (BarColumn(bar_width=15), MofNCompleteColumn(), TextColumn("episodes  {task.fields[figures]}"))
    with Progress(*columns, console=console) as bar:
        task = bar.add_task("search", total=None, figures="")

        def draw(campaign: Campaign) -> None:
            seen = campaign.progress
            bar.update(task, completed=seen.episodes_done, total=seen.episodes_total, figures=_figures(campaign))

        return client.wait(campaign_id, draw, away_s=AWAY_S)


def _figures(campaign: Campaign) -> str:
    seen = campaign.progress
    eta = "?" if seen.eta_s is None else f"{seen.eta_s:.0f} s"
    return (
        f"{seen.failures} valid, {seen.distinct_preventable} distinct preventable  "
        f"PCR {_number(seen.window_pcr)}  ETA {eta}"
    )


def _collect(client: Client, campaign: Campaign) -> Json:
    failures = [failure.model_dump(mode="json") for failure in client.failures(campaign.id)]
    found = campaign.model_dump(mode="json")
    return {
        "campaign": found,
        "results": client.results(campaign.id).model_dump(mode="json"),
        "failures": [failure | {"series": _series(found, failure)} for failure in failures],
    }


def _series(campaign: Json, failure: Json) -> str:
    """Where the time series of a failure lies in the data folder."""
    folder = _run_folder(Path(), campaign, failure["run_id"])
    return (folder / FAILURES / series_name(failure["index"])).as_posix()


def _run_folder(data_dir: Path, campaign: Json, run_id: str) -> Path:
    return ServiceSettings(data_dir=data_dir).run_folder(campaign["id"], run_id)


def _summarise(found: Json, console: Console) -> None:
    table = Table(title="What the search found", box=SIMPLE_HEAD, padding=0)  # 80 columns hold the longest method
    for name in COLUMNS:
        table.add_column(name, justify="left" if name == "method" else "right")
    for total in found["results"]["totals"]:
        table.add_row(
            total["method"],
            str(total["episodes"]),
            str(total["raw_collisions"]),
            str(total["failures"]),
            str(total["distinct_failures"]),
            str(total["distinct_preventable"]),
            _number(total["ecr"]),
            _number(total["pcr"]),
            f"{_number(total['pcr_low'])}-{_number(total['pcr_high'])}",
        )
    console.print(table)


def _invite(found: Json, data_dir: Path, console: Console) -> None:
    """The command that draws the first preventable failure of the first method that found one, or else any failure."""
    campaign = found["campaign"]
    in_order = [each for run in campaign["runs"] for each in found["failures"] if each["run_id"] == run["id"]]
    if not in_order:
        return
    first = next(filter(_preventable, in_order), in_order[0])
    program, here = Path(sys.executable).with_name("risk-sac"), Path.cwd()
    program = program.relative_to(here) if program.is_relative_to(here) else program
    folder = _run_folder(data_dir, campaign, first["run_id"])
    command = [program, "show", folder, first["id"], "--out", "failure.png"]
    console.print(f"draw one: {shlex.join(map(str, command))}", soft_wrap=True, markup=False, highlight=False)


def _verdict(found: Json, console: Console) -> int:
    campaign = found["campaign"]
    if campaign["state"] != "succeeded":
        console.print(f"campaign {campaign['state']}: {campaign['reason']}", style="bold red", markup=False)
        return 1
    distinct, worth = (campaign["progress"][name] for name in ("distinct_failures", "distinct_preventable"))
    if distinct == 0:
        console.print("no valid failure was found; try more --episodes or another --seeds", style="bold red")
        return 1
    console.print(f"distinct failures: {distinct}; a careful driver would have prevented: {worth}", style="bold green")
    return 0


def _preventable(failure: Json) -> bool:
    judgement = failure["collision"] and failure["collision"]["judgement"]
    return judgement is not None and judgement["grade"] == Grade.CAREFUL


def _number(value: float | None, digits: int = 2) -> str:
    return "-" if value is None else f"{value:.{digits}f}"


if __name__ == "__main__":
    sys.exit(main())
