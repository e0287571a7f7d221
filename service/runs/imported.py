"""Import of command-line run folders as ended campaigns; copies the folders.

An import is whole or absent: what an interrupted one leaves is removed at the next start, which imports again.
"""

import hashlib
import logging
import os
import shutil
import stat
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager
from itertools import islice
from pathlib import Path

from risk_sac.config import CampaignSpec
from risk_sac.errors import ConfigError, RiskSacError
from risk_sac.execution.messages import EpisodeDone, Finished
from risk_sac.metrics import MetricsAccumulator
from risk_sac.records import REPEATS, Phase, State
from risk_sac.report.files import SPEC, campaign_in
from risk_sac.report.runs import read_records, read_run
from risk_sac.run_folder.results import EPISODES, FAILURES, RESULTS, RunResults, read_results, series_name
from risk_sac.scenario.families import family_named
from service.settings import ServiceSettings
from service.store.reading import Store
from service.store.stored import StoredCampaign, StoredRun
from service.store.tables import IMPORTED
from service.store.writing import Ledger

logger = logging.getLogger(__name__)

AT_ONCE = 200  # number of episodes in one transaction
TELL_S = 10.0  # time between two lines of progress in the log
SPECIAL = {
    stat.S_IFLNK: "a symbolic link",
    stat.S_IFIFO: "a FIFO",
    stat.S_IFSOCK: "a socket",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
}


class _Stopped(Exception):
    pass


class Imports:
    """Thread that imports the campaigns of a folder, each once."""

    def __init__(
        self,
        settings: ServiceSettings,
        store: Store,
        ledger: Ledger,
        lock: AbstractContextManager[object],
        discard: Callable[[str], None],
    ) -> None:
        """Looks for campaigns in `settings.runs`, and imports nothing yet.

        Args:
          settings: of the service; `runs` is a run's folder, one of `risk-sac evaluate`, or a folder of such.
          store: of the service.
          ledger: takes the campaigns.
          lock: held while the ledger writes.
          discard: removes a campaign and its folder, by id.

        Raises:
          ConfigError: the folder holds no run.
        """
        assert settings.runs is not None
        self._settings, self._store, self._ledger = settings, store, ledger
        self._lock, self._discard = lock, discard
        self._folders = _folders(settings.runs)
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._work, name="imports", daemon=True)

    def start(self) -> None:
        """Starts the imports."""
        self._thread.start()

    def stop(self, timeout_s: float) -> None:
        """Interrupts the imports and waits for their end."""
        self._stopping.set()
        self._thread.join(timeout_s)

    def _work(self) -> None:
        for folder in self._folders:
            try:
                self._import(folder)
            except _Stopped:
                return
            except Exception as error:  # what files from anywhere raise is an open set
                bug = not isinstance(error, (RiskSacError, OSError))
                logger.warning("%s is not imported: %s", folder, error, exc_info=bug)

    def _import(self, folder: Path) -> None:
        check_plain(folder)
        spec, results = campaign_in([folder])
        spec = spec.model_copy(update={"label": spec.label or folder.name})
        finished = {each.spec_digest: (path, each) for path, each in results.items() if each.finished and each.digest}
        sources = {run.digest: finished[run.digest] for run in spec.runs() if run.digest in finished}
        if not sources:
            raise ConfigError("", "none of its runs is finished")
        key = _key(spec, {digest: each for digest, (_, each) in sources.items()})
        if self._ledger.find("default", key, spec) is not None:
            return
        campaign = self._begin(spec, key, sources)
        logger.info("importing %d runs of %s", len(sources), folder, extra={"campaign": campaign.id})
        try:
            runs = [run for run in campaign.runs if run.spec_digest in sources]
            done, total, told_at = 0, sum(run.episodes_total for run in runs), time.monotonic()
            for run in runs:
                for count in self._import_run(campaign, run, sources[run.spec_digest][0]):
                    done += count
                    if time.monotonic() > told_at + TELL_S:
                        told_at = time.monotonic()
                        logger.info("%d of %d episodes imported", done, total, extra={"campaign": campaign.id})
        except _Stopped:
            raise
        except Exception:
            with self._lock:
                self._discard(campaign.id)
            raise
        logger.info("%d runs imported", len(runs), extra={"campaign": campaign.id})

    def _begin(self, spec: CampaignSpec, key: str, sources: Mapping[str, object]) -> StoredCampaign:
        """Stores a campaign with no queued run, since workers would play it."""
        with self._lock:
            campaign = self._ledger.create(spec, key=key)
            for run in campaign.runs:
                if run.spec_digest in sources:
                    self._ledger.start_run(run.number)
                else:
                    self._ledger.end_run(run.number, State.CANCELLED)
        return campaign

    def _import_run(self, campaign: StoredCampaign, run: StoredRun, source: Path) -> Iterator[int]:
        """Imports a run unless cancelled; yields numbers of episodes as stored."""
        folder = self._settings.run_folder(campaign.id, run.id)
        if self._cancelled(run):
            return
        shutil.copytree(source, folder, symlinks=True, copy_function=self._copy)
        check_plain(folder)  # the source may have changed since it was checked
        result, events = _finished(folder), _events(folder)
        while some := [(run.number, event) for event in islice(events, AT_ONCE)]:
            self._check_going()
            if self._cancelled(run):
                return
            with self._lock:
                self._ledger.add_episodes(some)
            yield len(some)
        with self._lock:
            self._ledger.end_run(run.number, State.SUCCEEDED, result=result)

    def _cancelled(self, run: StoredRun) -> bool:
        with self._lock:
            cancelled = self._store.campaign_of(run.number).state is State.CANCELLING
            if cancelled:
                self._ledger.end_run(run.number, State.CANCELLED)
        return cancelled

    def _copy(self, source: str, target: str) -> None:
        self._check_going()
        shutil.copy2(source, target)

    def _check_going(self) -> None:
        if self._stopping.is_set():
            raise _Stopped


def _folders(root: Path) -> list[Path]:
    """Returns campaigns' folders: the root itself, or those right below it.

    Raises:
      ConfigError: there is none.
    """
    root = root.resolve()
    folders = root, *sorted(root.glob("*/"))
    found = [each for each in folders if any(os.path.lexists(each / name) for name in (SPEC, RESULTS))]
    if not found:
        raise ConfigError("RISK_SAC_RUNS", f"{root}, which holds no run", "the folder of a run, or a folder of such")
    return found[:1] if found[:1] == [root] else found


def check_plain(root: Path) -> None:
    """Raises ConfigError unless a folder holds only folders and plain files.

    What a link points at would be shown to everyone who may read the campaign.
    """
    paths = (Path(parent, name) for parent, folders, files in os.walk(root) for name in (*folders, *files))
    for path in (root, *paths):
        kind = stat.S_IFMT(path.lstat().st_mode)
        if kind not in (stat.S_IFREG, stat.S_IFDIR):
            got = f"{path}, which is {SPECIAL.get(kind, 'a special file')}"
            remedy = "replace it by a copy of what it stands for, or remove it"
            raise ConfigError("RISK_SAC_RUNS", got, "folders and plain files alone", remedy)


def _key(spec: CampaignSpec, runs: Mapping[str, RunResults]) -> str:
    """Returns an import's idempotency key; its space tells it from posted ones."""
    digests = sorted(str(run.digest) for run in runs.values())
    return f"{IMPORTED}{hashlib.sha256(''.join((spec.digest, *digests)).encode()).hexdigest()}"


def _events(folder: Path) -> Iterator[EpisodeDone]:
    """Yields the messages that a run folder's worker would have sent."""
    results = read_results(folder)
    records = read_records(folder / EPISODES)
    accumulators: dict[str, MetricsAccumulator] = {}
    for record in records:
        if record.phase not in accumulators:
            accumulators[record.phase] = MetricsAccumulator(family_named(results.spec.family).horizon_steps)
        name = None if record.worst_violation is None else series_name(record.index)
        yield EpisodeDone(
            record=record,
            metrics=accumulators[record.phase].add(record),
            series=name,
            series_sha256=name and _sha256(folder / FAILURES / name),
            wall_s=results.wall_s / len(records),
        )


def _sha256(file: Path) -> str:
    with file.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def _finished(folder: Path) -> Finished:
    """Returns the last message that a run folder's worker would have sent."""
    results, run = read_results(folder), read_run(folder)
    search: Phase = "iid" if results.spec.iid else "search"
    return Finished(
        finished=True,
        metrics=run.metrics[search],
        evaluation=run.metrics.get("evaluation"),
        digest=run.digest,
        versions=run.versions,
        wall_s=run.wall_s,
        repetitions=run.verified.episodes if run.verified else {},
        flaky={each.index: refused for each in run.records if (refused := each.refused_by(REPEATS))},
    )
