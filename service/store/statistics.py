"""What the service has done and does now, for its monitoring: sums over runs, never over episodes."""

from collections.abc import Mapping
from dataclasses import dataclass

from pydantic_core import from_json
from sqlalchemy import Engine, func, select

from service.store.database import storage_errors
from service.store.states import State
from service.store.tables import TALLIED, CampaignRow, RunRow


@dataclass(frozen=True, slots=True)
class Tally:
    """All runs of one family and method in one state."""

    family: str
    method: str
    state: State
    runs: int
    counts: Mapping[str, int]  # `TALLIED`


@dataclass(frozen=True, slots=True)
class AtWork:
    """A run that has a worker."""

    campaign_id: str
    id: str
    family: str
    method: str
    ecr: float | None  # None before its first episode
    pcr: float | None


@dataclass(frozen=True, slots=True)
class Statistics:
    """The whole of it."""

    campaigns: dict[State, int]
    tallies: tuple[Tally, ...]
    at_work: tuple[AtWork, ...]


def read_statistics(engine: Engine) -> Statistics:
    """What the database says now.

    Raises:
      StorageError: it cannot be read.
    """
    campaigns = select(CampaignRow.state, func.count()).group_by(CampaignRow.state)
    sums = (func.count(), *(func.sum(getattr(RunRow, name)) for name in TALLIED))
    tallies = select(RunRow.family, RunRow.method, RunRow.state, *sums)
    at_work = (
        select(CampaignRow.id, RunRow.id, RunRow.family, RunRow.method, RunRow.metrics)
        .join(RunRow.campaign)
        .where(RunRow.state.in_([State.RUNNING, State.CANCELLING]))
        .order_by(RunRow.number)
    )
    with storage_errors("reading"), engine.connect() as connection:
        return Statistics(
            campaigns={State(state): count for state, count in connection.execute(campaigns)},
            tallies=tuple(
                Tally(family, method, State(state), runs, dict(zip(TALLIED, counts, strict=True)))
                for family, method, state, runs, *counts in connection.execute(
                    tallies.group_by(RunRow.family, RunRow.method, RunRow.state)
                )
            ),
            at_work=tuple(
                AtWork(campaign_id, run_id, family, method, *_rates(metrics))
                for campaign_id, run_id, family, method, metrics in connection.execute(at_work)
            ),
        )


def check_readable(engine: Engine) -> None:
    """Ask the database for as little as it can be asked for.

    Raises:
      StorageError: it cannot be read.
    """
    with storage_errors("reading"), engine.connect() as connection:
        connection.execute(select(CampaignRow.number).limit(1)).first()


def _rates(metrics: str | None) -> tuple[float | None, float | None]:
    """ECR and PCR; what was stored before contacts were judged has none of the latter."""
    known = {} if metrics is None else from_json(metrics)
    return known.get("ecr"), known.get("pcr")
