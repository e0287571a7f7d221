"""Imports run folders of the command line as ended campaigns; the folders are copied."""

import hashlib
import logging
import shutil
from collections.abc import Iterator, Mapping
from itertools import islice
from pathlib import Path

from risk_sac.config import CampaignSpec
from risk_sac.errors import ConfigError
from risk_sac.execution.messages import EpisodeDone, Finished
from risk_sac.metrics import MetricsAccumulator
from risk_sac.records import REPEATS, Phase, State
from risk_sac.report.inputs import SPEC, campaign_in
from risk_sac.report.runs import read_records, read_run
from risk_sac.run_folder.results import EPISODES, FAILURES, RESULTS, read_results, series_name
from risk_sac.scenario.families import family_named
from service.settings import ServiceSettings
from service.store.stored import StoredCampaign
from service.store.writing import Ledger

logger = logging.getLogger(__name__)

AT_ONCE = 200  # episodes in one transaction


def import_runs(root: Path, settings: ServiceSettings, ledger: Ledger) -> None:
    """Imports each campaign in a folder that was not imported before; warns of those that cannot be read.

    Args:
      root: a run's folder, one of `risk-sac evaluate`, or a folder of such.
      settings: of the service.
      ledger: takes the campaigns.

    Raises:
      ConfigError: the folder holds no run.
    """
    folders = _folders(root)
    if not folders:
        raise ConfigError("RISK_SAC_RUNS", f"{root}, which holds no run", "the folder of a run, or a folder of such")
    for folder in folders:
        try:
            spec, results = campaign_in([folder])
            spec = spec.model_copy(update={"label": spec.label or folder.name})
            _import(spec, {each.spec_digest: path for path, each in results.items() if each.finished}, settings, ledger)
        except (ConfigError, OSError) as error:
            logger.warning("%s is not imported: %s", folder, error)


def _folders(root: Path) -> list[Path]:
    """Returns the folders of campaigns: the root itself, or those right below it."""
    found = [
        each for each in (root, *sorted(root.glob("*/"))) if any((each / name).is_file() for name in (SPEC, RESULTS))
    ]
    return found[:1] if found[:1] == [root] else found


def _import(spec: CampaignSpec, folders: Mapping[str, Path], settings: ServiceSettings, ledger: Ledger) -> None:
    """Imports the finished runs of a campaign, by digest of their specs; the other runs are cancelled."""
    runs = {digest: read_run(folder) for digest, folder in folders.items()}
    if not runs:
        raise ConfigError("", "none of its runs is finished")
    key = hashlib.sha256("".join((spec.digest, *sorted(run.digest for run in runs.values()))).encode()).hexdigest()
    if ledger.find("default", f"imported {key}", spec) is not None:
        return
    campaign = ledger.create(spec, key=f"imported {key}")
    try:
        _copy(campaign, folders, settings, ledger)
    finally:  # else a worker would play what was not imported
        ledger.cancel(campaign.id)
    logger.info("%d runs imported", len(runs), extra={"campaign": campaign.id})


def _copy(campaign: StoredCampaign, folders: Mapping[str, Path], settings: ServiceSettings, ledger: Ledger) -> None:
    for stored in campaign.runs:
        if stored.spec_digest not in folders:
            continue
        folder = settings.run_folder(campaign.id, stored.id)
        shutil.copytree(folders[stored.spec_digest], folder)
        ledger.start_run(stored.number)
        events = _events(folder)
        while some := [(stored.number, event) for event in islice(events, AT_ONCE)]:
            ledger.add_episodes(some)
        ledger.end_run(stored.number, State.SUCCEEDED, result=_finished(folder))


def _events(folder: Path) -> Iterator[EpisodeDone]:
    """Yields the messages that a worker would have sent of the run in a folder."""
    results = read_results(folder)
    records = read_records(folder / EPISODES)
    found: dict[str, MetricsAccumulator] = {}
    for record in records:
        if record.phase not in found:
            found[record.phase] = MetricsAccumulator(family_named(results.spec.family).horizon_steps)
        name = None if record.worst_violation is None else series_name(record.index)
        yield EpisodeDone(
            record=record,
            metrics=found[record.phase].add(record),
            series=name,
            series_sha256=name and hashlib.sha256((folder / FAILURES / name).read_bytes()).hexdigest(),
            wall_s=results.wall_s / len(records),
        )


def _finished(folder: Path) -> Finished:
    """Returns the last message that a worker would have sent of the run in a folder."""
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
