"""Rows of the database as the frozen snapshots that the store hands out."""

from collections.abc import Mapping

from pydantic import TypeAdapter

from risk_sac.metrics import Funnel
from risk_sac.types import EpisodeRecord, RunMetrics
from service.store.records import StoredCampaign, StoredChange, StoredEpisode, StoredRun
from service.store.states import State
from service.store.tables import CampaignRow, ChangeRow, EpisodeRow, RunRow

_METRICS: TypeAdapter[RunMetrics] = TypeAdapter(RunMetrics)
_FUNNEL: TypeAdapter[Funnel] = TypeAdapter(Funnel)
_RECORD: TypeAdapter[EpisodeRecord] = TypeAdapter(EpisodeRecord)
_VERSIONS: TypeAdapter[dict[str, str]] = TypeAdapter(dict[str, str])


def campaign_record(row: CampaignRow, revision: str) -> StoredCampaign:
    """The snapshot of a row and its runs."""
    return StoredCampaign(
        number=row.number,
        id=row.id,
        project=row.project,
        label=row.label,
        spec_json=row.spec,
        state=State(row.state),
        reason=row.reason,
        created_at=row.created_at,
        started_at=row.started_at,
        finished_at=row.finished_at,
        revision=revision,
        runs=tuple(run_record(run, row.id) for run in row.runs),
    )


def run_record(row: RunRow, campaign_id: str) -> StoredRun:
    """The snapshot of a run; `row.campaign` is not asked for the id, since that costs as much as all else of it."""
    return StoredRun(
        number=row.number,
        campaign_id=campaign_id,
        id=row.id,
        family=row.family,
        method=row.method,
        seed=row.seed,
        spec_digest=row.spec_digest,
        state=State(row.state),
        reason=row.reason,
        started_at=row.started_at,
        finished_at=row.finished_at,
        episodes_total=row.episodes_total,
        episodes_done=row.episodes_done,
        rejected=row.rejected,
        raw_collisions=row.raw_collisions,
        failures=row.failures,
        distinct_failures=row.distinct_failures,
        preventable=row.preventable,
        distinct_preventable=row.distinct_preventable,
        busy_s=row.busy_s,
        attempts=row.attempts,
        metrics=_metrics(row.metrics),
        evaluation=_metrics(row.evaluation),
        digest=row.digest,
        versions=_versions(row.versions),
    )


def _metrics(text: str | None) -> RunMetrics | None:
    return None if text is None else _METRICS.validate_json(text)


def _versions(text: str) -> Mapping[str, str]:
    return _VERSIONS.validate_json(text)


def episode_record(row: EpisodeRow) -> StoredEpisode:
    """The snapshot of an episode."""
    return StoredEpisode(
        number=row.number,
        run_id=row.run.id,
        record=_RECORD.validate_json(row.record),
        series=row.series,
        series_sha256=row.series_sha256,
        wall_s=row.wall_s,
        funnel=None if row.funnel is None else _FUNNEL.validate_json(row.funnel),
        sequence=row.sequence,
    )


def change_record(row: ChangeRow) -> StoredChange:
    """The snapshot of a change."""
    return StoredChange(sequence=row.sequence, run_id=row.run_id, state=State(row.state), reason=row.reason, at=row.at)
