"""Damaged files are noticed: recovered from the last good state, or refused.

What is read of a file afterwards is either what was read before, or an error that says what is damaged. A database
that SQLite's integrity check refuses is not opened; a bit that flips within the text of a row may be read as it is.
"""

import multiprocessing
import shutil
import signal
from collections.abc import Callable
from pathlib import Path
from random import Random
from typing import Any

import pytest

from risk_sac.config import RunSpec
from risk_sac.errors import RiskSacError
from risk_sac.records import State
from risk_sac.run_folder.results import FAILURES, RESULTS
from service.errors import StorageError
from service.settings import ServiceSettings
from service.store.reading import Store
from service.views.reports import Reports
from service.views.series import failure_body
from tests.server import servers

SPEC = {
    "families": ["low"],
    "methods": ["bo-only", "random"],
    "budget": {"episodes": 12},
    "learner": {"checkpoint_every": 2},
}
DATABASE = "risk-sac.db"
pytestmark = pytest.mark.torture  # the suite damages checkpoints, rows and results one by one


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Data folder with an ended campaign and one that a kill interrupted."""
    folder = tmp_path_factory.mktemp("damage")
    with servers(folder) as serve:
        service = serve("risk_sac.execution.worker", lease_s=60)
        assert service.wait(service.post(**SPEC))["state"] == "succeeded"
        interrupted = service.post(**SPEC | {"budget": {"episodes": 400}})
        service.wait_for(interrupted, lambda seen: all(run["episodes_done"] > 5 for run in seen["runs"]))
        service.stop(signal.SIGKILL)
        service.wait_until(lambda: service.workers() == [], timeout_s=10, alive=False)
    return folder / "data"


def damage(path: Path, random: Random) -> str:
    """Cut a file short, or flip one of its bits."""
    content = bytearray(path.read_bytes())
    at = random.randrange(len(content))
    if random.random() < 0.25:
        path.write_bytes(content[:at])
        return f"{path.name} cut to {at} of {len(content)} bytes"
    content[at] ^= 1 << random.randrange(8)
    path.write_bytes(content)
    return f"{path.name} with a bit flipped at {at} of {len(content)}"


def readings(data: Path) -> dict[str, object]:
    """Returns all that the service reads of a folder, or the error."""
    settings = ServiceSettings(data_dir=data)
    try:
        store = Store(settings.url)
    except StorageError as error:
        return {"": error}
    found: dict[str, object] = {}

    def read(name: str, reading: Callable[[], Any]) -> Any:
        try:
            found[name] = reading()
        except RiskSacError as error:
            found[name] = error
        return found[name]

    campaigns = read("campaigns", lambda: store.campaigns(limit=10).items)
    for campaign in () if isinstance(campaigns, Exception) else campaigns:
        read(f"{campaign.id} events", lambda id_=campaign.id: store.events(id_, limit=10_000).items)
        episodes = read(f"{campaign.id} episodes", lambda id_=campaign.id: store.episodes(id_, limit=1000).items)
        for episode in () if isinstance(episodes, Exception) else episodes:
            if episode.collision is not None:
                name = f"{campaign.id} {episode.id}"
                contact = read(name, lambda id_=campaign.id, of=episode.id: store.failure(id_, of))
                if not isinstance(contact, Exception):
                    body = failure_body(campaign.id, contact, None, settings)
                    found[name] = StorageError(body.series_problem) if body.series_problem else body
        if campaign.state is State.SUCCEEDED:
            report = Reports(settings).report(campaign)
            found[f"{campaign.id} table"] = report.comparison if report.lasting else StorageError("runs are lost")
    store.close()
    return found


def told_files(data: Path) -> list[Path]:
    """Returns series that an episode names, and results that a table shows."""
    settings = ServiceSettings(data_dir=data)
    store = Store(settings.url)
    found = []
    for campaign in store.campaigns(limit=10).items:
        for episode in store.episodes(campaign.id, limit=1000).items:
            if episode.collision is not None:
                series = store.failure(campaign.id, episode.id).series
                assert series is not None
                found.append(settings.run_folder(campaign.id, episode.run_id) / FAILURES / series)
        if campaign.state is State.SUCCEEDED:
            found += [settings.run_folder(campaign.id, run.id) / RESULTS for run in campaign.runs]
    store.close()
    return sorted(found)


def any_error(found: dict[str, object]) -> bool:
    """Whether any reading is told to be damaged."""
    return any(isinstance(reading, Exception) for reading in found.values())


def noticed(before: dict[str, object], after: dict[str, object]) -> bool:
    """Returns whether any damage is reported; all else must be as before."""
    errors = {name for name, reading in after.items() if isinstance(reading, Exception)}
    for name, reading in after.items():
        assert name in errors or (name in before and repr(reading) == repr(before[name])), name
    if "" not in errors and "campaigns" not in errors:
        assert not (missing := before.keys() - after.keys()) or any("episodes" in name for name in errors), missing
    return bool(errors)


@pytest.mark.timeout(1800)
def test_a_damaged_database_is_refused_or_read_with_one_row_changed(data, tmp_path, times, chance, tell):
    source = tmp_path / "source"
    shutil.copytree(data, source)
    before = readings(source)  # this also works the journal in
    seen = 0
    for _ in range(times(15, 100)):
        copy = tmp_path / "copy"
        shutil.copytree(source, copy, copy_function=shutil.copy)
        what = damage(copy / DATABASE, chance)
        after = readings(copy)
        assert "" in after or after.keys() == before.keys() or any_error(after), what
        assert "" in after or " cut to " not in what, what
        seen += any_error(after)
        shutil.rmtree(copy)
    tell(f"database: {times(15, 100)} damaged, {seen} noticed, the others without effect but on the text of one row")


@pytest.mark.timeout(1800)
def test_a_damaged_result_or_series_is_noticed(data, tmp_path, times, chance, tell):
    source = tmp_path / "source"
    shutil.copytree(data, source)
    before = readings(source)
    read = [path.relative_to(source) for path in told_files(source)]
    seen = 0
    for _ in range(times(15, 100)):
        copy = tmp_path / "copy"
        shutil.copytree(source, copy)
        what = damage(copy / chance.choice(read), chance)
        assert noticed(before, readings(copy)), what
        seen += 1
        shutil.rmtree(copy)
    tell(f"artefacts: {seen} damaged, {seen} noticed")


@pytest.mark.timeout(3600)
def test_a_run_with_a_damaged_file_goes_on_from_the_last_good_one(data, tmp_path, times, chance, tell):
    store = Store(ServiceSettings(data_dir=data).url)
    campaign = store.campaigns(limit=1).items[0]
    store.close()
    run = chance.choice([run for run in campaign.runs if run.method == "random"])
    spec = campaign.run_spec(run)
    spec = spec.model_copy(update={"budget": spec.budget.model_copy(update={"episodes": 40})})
    fresh = tmp_path / "fresh"
    undisturbed = go_on(spec, fresh)
    assert len(undisturbed) == 64, undisturbed
    outcomes = {"same result": 0, "refused with the reason": 0}
    for number in range(times(10, 100)):
        folder = tmp_path / f"case{number}"
        go_on(spec, folder, stop_after=chance.randrange(5, 35))
        victims = sorted(path for path in folder.iterdir() if path.is_file() and path.stat().st_size)
        what = damage(chance.choice(victims), chance)
        outcome = go_on(spec, folder)
        assert outcome == undisturbed or outcome.startswith("refused: "), (what, outcome)
        outcomes["same result" if outcome == undisturbed else "refused with the reason"] += 1
        shutil.rmtree(folder)
    tell(f"run folders: {times(10, 100)} damaged, {outcomes}")


def go_on(spec: RunSpec, folder: Path, stop_after: int | None = None) -> str:
    """Starts or continues a run in a process; returns digest or reason."""
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["risk_sac.execution.evaluate"])
    receiver, sender = context.Pipe(duplex=False)
    with receiver, sender:
        process = context.Process(target=_run, args=(spec, folder, stop_after, sender))
        process.start()
        assert receiver.poll(300), "it says nothing"
        outcome: str = receiver.recv()
        process.join()
        process.close()
    return outcome


def _run(spec: RunSpec, folder: Path, stop_after: int | None, sender: Any) -> None:
    import os

    from risk_sac.execution.evaluate import run

    def progress(done: int, metrics: object) -> None:
        if done == stop_after:
            os.kill(os.getpid(), signal.SIGTERM)

    try:
        sender.send(run(spec, folder, progress).digest or "")
    except (RiskSacError, OSError) as error:
        sender.send(f"refused: {error}")
