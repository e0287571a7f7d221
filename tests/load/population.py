"""A database as large as a service gets: every row is made like those of a real campaign."""

import itertools
import math
import re
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from operator import itemgetter
from pathlib import Path
from typing import Any

from sqlalchemy import Connection, func, insert, inspect, select
from sqlalchemy.orm import Session

from risk_sac.config import METHODS, CampaignSpec
from risk_sac.records import Outcome
from risk_sac.scenario.families import FAMILIES
from service.store.database import open_database
from service.store.states import State
from service.store.tables import Base, CampaignRow, ChangeRow, EpisodeRow, RunRow

BATCH = 10_000  # rows of one statement
LABELS = ("", "nightly", "release", "cut-ins")
RARE_LABEL = "seldom"  # of one campaign, an old one
STATES = (*[State.SUCCEEDED] * 17, State.FAILED, State.FAILED, State.CANCELLED)
SEEDS = (0, 1)
LARGE_SEEDS, LARGE_SHARE = tuple(range(5)), 0.06  # one campaign compares all that there is; its share of the episodes
APART_S = 60.0
_INDEX = re.compile(r'^\{"index":\d+')

Values = dict[str, Any]


@dataclass(frozen=True, slots=True)
class Patterns:
    """Rows of a real campaign to make others of."""

    spec: CampaignSpec
    run: Values
    episodes: tuple[Values, ...]


@dataclass(frozen=True, slots=True)
class Plan:
    """A campaign to be written."""

    number: int
    spec: CampaignSpec
    state: State
    at: float  # when it was posted

    @property
    def id(self) -> str:
        """As routes name it."""
        return f"c{self.number:016x}"

    @property
    def events(self) -> int:
        """How many there are: each episode, and beginnings and ends of the runs and of the campaign."""
        runs = self.spec.runs()
        return sum(run.budget.episodes for run in runs) + 2 * (len(runs) + 1)


def populate(data_dir: Path, campaigns: int, episodes: int) -> tuple[Plan, ...]:
    """Fill the database of a service that is stopped and has run a small campaign; returns what was added.

    Args:
      data_dir: of the service.
      campaigns: how many to add, at least 2.
      episodes: how many to add, over all of them.
    """
    engine = open_database(f"sqlite:///{data_dir / 'risk-sac.db'}")
    try:
        with Session(engine) as session:
            patterns = _patterns(session)
            numbers = [session.scalar(select(func.max(table.number))) for table in (CampaignRow, RunRow, EpisodeRow)]
        plans = tuple(_plans(patterns.spec, numbers[0], campaigns, episodes))
        with engine.begin() as connection:
            _write(connection, plans, patterns, *numbers[1:])
    finally:
        engine.dispose()
    return plans


def _patterns(session: Session) -> Patterns:
    campaign = session.scalars(select(CampaignRow)).first()
    run = session.scalars(select(RunRow).where(RunRow.metrics.is_not(None))).first()
    assert campaign is not None
    assert run is not None
    episodes = session.scalars(select(EpisodeRow).where(EpisodeRow.run_number == run.number))
    return Patterns(
        CampaignSpec.model_validate_json(campaign.spec), _values(run), tuple(_values(episode) for episode in episodes)
    )


def _values(row: Base) -> Values:
    return {name: getattr(row, name) for name in inspect(type(row)).columns.keys()}  # noqa: SIM118


def _plans(pattern: CampaignSpec, last: int, campaigns: int, episodes: int) -> Iterator[Plan]:
    """All alike but for a large one in the middle and a label near the beginning that only one has."""
    searches = list(itertools.product(FAMILIES, METHODS))
    usual = max(1, int((1 - LARGE_SHARE) * episodes / (campaigns - 1) / len(SEEDS)))
    left = episodes - usual * len(SEEDS) * (campaigns - 1)
    large = max(1, math.ceil(left / len(searches) / len(LARGE_SEEDS)))
    now = time.time()
    for place in range(campaigns):
        if place == campaigns // 2:
            search, seeds, count = (tuple(FAMILIES), tuple(METHODS)), LARGE_SEEDS, large
        else:
            family, method = searches[place * 7 % len(searches)]
            search, seeds, count = ((family,), (method,)), SEEDS, usual
        spec = pattern.model_copy(
            update={
                "label": RARE_LABEL if place == campaigns // 10 else LABELS[place % len(LABELS)],
                "families": search[0],
                "methods": search[1],
                "seeds": seeds,
                "budget": pattern.budget.model_copy(update={"episodes": count}),
            }
        )
        yield Plan(last + 1 + place, spec, STATES[place * 3 % len(STATES)], now - APART_S * (campaigns - place))


def _write(connection: Connection, plans: Sequence[Plan], patterns: Patterns, last_run: int, last_episode: int) -> None:
    """All rows; parents before their children, and each table in the order of its numbers."""
    runs = [run for plan in plans for run in _runs(plan, patterns)]
    for number, run in enumerate(runs, last_run + 1):
        run["number"] = number
    outcomes = _outcomes(patterns)
    _insert(connection, CampaignRow, (_campaign(plan) for plan in plans))
    _insert(connection, RunRow, (run | _counts(outcomes, run["episodes_total"]) for run in runs))
    campaigns = itertools.groupby(runs, itemgetter("campaign_number"))
    episodes = (episode for _, own in campaigns for episode in _numbered(list(own), patterns))
    _insert(connection, EpisodeRow, (row | {"number": n} for n, row in enumerate(episodes, last_episode + 1)))
    _insert(connection, ChangeRow, (change for plan in plans for change in _changes(plan)))


def _insert(connection: Connection, table: type[Base], rows: Iterator[Values]) -> None:
    while batch := list(itertools.islice(rows, BATCH)):
        connection.execute(insert(table), batch)


def _campaign(plan: Plan) -> Values:
    return {
        "number": plan.number,
        "id": plan.id,
        "project": "default",
        "label": plan.spec.label,
        "idempotency_key": None,
        "spec": plan.spec.model_dump_json(),
        "state": plan.state,
        "reason": None,
        "created_at": plan.at,
        "started_at": plan.at + 1,
        "finished_at": plan.at + APART_S,
        "revision": plan.spec.budget.episodes,
        "events": plan.events,
    }


def _runs(plan: Plan, patterns: Patterns) -> Iterator[Values]:
    for run in plan.spec.runs():
        yield patterns.run | {
            "campaign_number": plan.number,
            "id": run.id,
            "family": run.family,
            "method": run.method,
            "seed": run.seed,
            "spec_digest": run.digest,
            "state": plan.state,
            "started_at": plan.at + 1,
            "finished_at": plan.at + APART_S,
            "episodes_total": run.budget.episodes,
        }


def _outcomes(patterns: Patterns) -> list[Outcome]:
    return [Outcome(episode["outcome"]) for episode in patterns.episodes]


def _counts(outcomes: Sequence[Outcome], episodes: int) -> Values:
    """What a run counts of episodes whose outcomes repeat."""
    counts = Counter(itertools.islice(itertools.cycle(outcomes), episodes))
    return {
        "episodes_done": episodes,
        "rejected": counts[Outcome.REJECTED],
        "failures": counts[Outcome.FAILURE],
        "raw_collisions": counts[Outcome.FAILURE] + counts[Outcome.DEGENERATE],
    }


def _numbered(runs: Sequence[Values], patterns: Patterns) -> Iterator[Values]:
    """Episodes of a campaign, among its events after the beginnings of its runs and its own."""
    episodes = itertools.chain.from_iterable(_episodes(run, patterns) for run in runs)
    return (row | {"sequence": sequence} for sequence, row in enumerate(episodes, len(runs) + 2))


def _episodes(run: Values, patterns: Patterns) -> Iterator[Values]:
    for index, pattern in enumerate(itertools.islice(itertools.cycle(patterns.episodes), run["episodes_total"])):
        yield pattern | {
            "campaign_number": run["campaign_number"],
            "run_number": run["number"],
            "index": index,
            "record": _INDEX.sub(f'{{"index":{index}', pattern["record"], count=1),
        }


def _changes(plan: Plan) -> Iterator[Values]:
    ids = [None, *(run.id for run in plan.spec.runs())]
    ends = plan.events - len(ids)
    for state, at, before in ((State.RUNNING, plan.at + 1, 0), (plan.state, plan.at + APART_S, ends)):
        of_all = {"campaign_number": plan.number, "state": state, "reason": None, "at": at}
        for sequence, run_id in enumerate(ids, before + 1):
            yield of_all | {"run_id": run_id, "sequence": sequence}
