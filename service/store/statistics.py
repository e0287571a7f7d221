"""Statistics for monitoring: sums over runs, never over episodes."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from sqlalchemy import Engine, Row, func, select

from risk_sac.metrics.requirements import STEPS
from risk_sac.records import State
from service.store.database import storage_errors
from service.store.tables import TALLIED, CampaignRow, RequirementRow, RunRow


@dataclass(frozen=True, slots=True)
class Statistics:
    """The whole of it, as rows with names."""

    campaigns: Sequence[Row[Any]]  # state, campaigns
    tallies: Sequence[Row[Any]]  # family, method, state, runs, `TALLIED`
    requirements: Sequence[Row[Any]]  # name, `STEPS`
    at_work: Sequence[Row[Any]]  # campaign_id, id, family, method, metrics of each run that has a worker


def read_statistics(engine: Engine) -> Statistics:
    """Reads the current statistics from the database."""
    campaigns = select(CampaignRow.state, func.count().label("campaigns")).group_by(CampaignRow.state)
    sums = (func.sum(getattr(RunRow, name)).label(name) for name in TALLIED)
    kind = (RunRow.family, RunRow.method, RunRow.state)
    tallies = select(*kind, func.count().label("runs"), *sums).group_by(*kind)
    steps = (func.sum(getattr(RequirementRow, step)).label(step) for step in STEPS)
    requirements = select(RequirementRow.name, *steps).group_by(RequirementRow.name)
    at_work = (
        select(CampaignRow.id.label("campaign_id"), RunRow.id, RunRow.family, RunRow.method, RunRow.metrics)
        .join(RunRow.campaign)
        .where(RunRow.state.in_([State.RUNNING, State.CANCELLING]))
        .order_by(RunRow.number)
    )
    with storage_errors("reading"), engine.connect() as connection:
        return Statistics(*(connection.execute(query).all() for query in (campaigns, tallies, requirements, at_work)))


def check_readable(engine: Engine) -> None:
    """Ask the database for as little as it can be asked for."""
    with storage_errors("reading"), engine.connect() as connection:
        connection.execute(select(CampaignRow.number).limit(1)).first()
