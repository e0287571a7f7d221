"""The database: campaigns, their runs, the runs' episodes, what changed when, triages, usage, the server's own.

Records of the method are stored as the JSON that the worker sent; what is filtered or counted has a
column of its own. Numbers are primary keys in order of arrival, so that a page continues where the
last one ended however much was inserted meanwhile. Its history is in `service.store.migrations`.

Every row carries a checksum of its other columns, because a database notices only some of the bits
that a disk flips. It is written with the row and verified whenever the row is read.
"""

import zlib
from collections.abc import Callable
from functools import cache
from operator import attrgetter
from typing import Any

from pydantic_core import to_json
from sqlalchemy import BigInteger, ForeignKey, Index, Text, event, inspect, text
from sqlalchemy.orm import DeclarativeBase, Mapped, Mapper, mapped_column, relationship
from sqlalchemy.sql.schema import ScalarElementColumnDefault

from service.errors import StorageError

# What is summed up over runs, per family, method and state.
TALLIED = (
    "episodes_done",
    "raw_collisions",
    "failures",
    "distinct_failures",
    "preventable",
    "distinct_preventable",
)
LATER = {"later": True}  # of a column that came after checksums: summed only where it holds something


def _of_judged(name: str, *columns: str) -> Index:
    """An index that the many episodes without a contact take no room in."""
    judged = text(f"{columns[1]} IS NOT NULL")
    return Index(name, *columns, sqlite_where=judged, postgresql_where=judged)


class Base(DeclarativeBase):
    """Root of the mapped tables."""


class Checked:
    """A row that carries its checksum; None in rows from before there was one."""

    checksum: Mapped[int | None] = mapped_column(BigInteger)


class CampaignRow(Checked, Base):
    """A posted campaign."""

    __tablename__ = "campaigns"
    __table_args__ = (
        Index("campaigns_idempotency", "project", "idempotency_key", unique=True),
        Index("campaigns_state", "state", "number"),
        Index("campaigns_label", "label", "number"),
        Index("campaigns_project", "project", "number"),
        {"sqlite_autoincrement": True},
    )

    number: Mapped[int] = mapped_column(primary_key=True)
    id: Mapped[str] = mapped_column(unique=True)
    project: Mapped[str]
    label: Mapped[str]
    idempotency_key: Mapped[str | None]
    spec: Mapped[str] = mapped_column(Text)
    state: Mapped[str]
    reason: Mapped[str | None]
    created_at: Mapped[float]
    started_at: Mapped[float | None]
    finished_at: Mapped[float | None]
    revision: Mapped[int] = mapped_column(default=1)
    events: Mapped[int] = mapped_column(default=0, info=LATER)  # how many there are, which is the last one's sequence
    runs: Mapped[list["RunRow"]] = relationship(back_populates="campaign", order_by="RunRow.number")


class RunRow(Checked, Base):
    """One (family, method, seed) of a campaign."""

    __tablename__ = "runs"
    __table_args__ = (
        Index("runs_ids", "campaign_number", "id", unique=True),
        Index("runs_queue", "state", "number"),
        Index("runs_families", "family", "campaign_number"),
        Index("runs_methods", "method", "campaign_number"),
        Index("runs_tallies", "family", "method", "state", *TALLIED),  # all that metrics sum up
        {"sqlite_autoincrement": True},
    )

    number: Mapped[int] = mapped_column(primary_key=True)
    campaign_number: Mapped[int] = mapped_column(ForeignKey("campaigns.number"))
    id: Mapped[str]
    family: Mapped[str]
    method: Mapped[str]
    seed: Mapped[int]
    spec_digest: Mapped[str]
    state: Mapped[str]
    reason: Mapped[str | None]
    started_at: Mapped[float | None]
    finished_at: Mapped[float | None]
    episodes_total: Mapped[int]
    episodes_done: Mapped[int] = mapped_column(default=0)
    rejected: Mapped[int] = mapped_column(default=0)
    raw_collisions: Mapped[int] = mapped_column(default=0)
    failures: Mapped[int] = mapped_column(default=0)
    distinct_failures: Mapped[int] = mapped_column(default=0, info=LATER)
    preventable: Mapped[int] = mapped_column(default=0, info=LATER)
    distinct_preventable: Mapped[int] = mapped_column(default=0, info=LATER)
    busy_s: Mapped[float] = mapped_column(default=0.0)
    attempts: Mapped[int] = mapped_column(default=0)
    metrics: Mapped[str | None] = mapped_column(Text)
    evaluation: Mapped[str | None] = mapped_column(Text)
    digest: Mapped[str | None]
    versions: Mapped[str] = mapped_column(Text, default="{}")
    repetitions: Mapped[str | None] = mapped_column(Text, info=LATER)  # of its distinct failures, by episode's index
    campaign: Mapped[CampaignRow] = relationship(back_populates="runs")


class EpisodeRow(Checked, Base):
    """One episode of a run; a resumed run may report it again, which replaces it."""

    __tablename__ = "episodes"
    __table_args__ = (
        Index("episodes_ids", "run_number", "phase", "index", unique=True),
        Index("episodes_pages", "campaign_number", "number"),
        Index("episodes_sequence", "campaign_number", "sequence", unique=True),
        Index("episodes_runs", "run_number", "number"),
        Index("episodes_outcomes", "campaign_number", "outcome", "number"),
        *(_of_judged(f"episodes_{name}s", "campaign_number", name, "number") for name in ("grade", "signature")),
        {"sqlite_autoincrement": True},
    )

    number: Mapped[int] = mapped_column(primary_key=True)
    campaign_number: Mapped[int] = mapped_column(ForeignKey("campaigns.number"))
    run_number: Mapped[int] = mapped_column(ForeignKey("runs.number"))
    phase: Mapped[str]
    index: Mapped[int]
    outcome: Mapped[str]
    record: Mapped[str] = mapped_column(Text)
    series: Mapped[str | None]
    series_sha256: Mapped[str | None]
    wall_s: Mapped[float]
    grade: Mapped[str | None] = mapped_column(info=LATER)  # of a valid failure
    signature: Mapped[str | None] = mapped_column(info=LATER)  # of a contact
    broke: Mapped[str | None] = mapped_column(info=LATER)  # what its striker broke, between commas: ",red_light,"
    funnel: Mapped[str | None] = mapped_column(Text, info=LATER)  # of the run's phase, this episode included
    sequence: Mapped[int] = mapped_column(info=LATER)  # among the campaign's events: 1, 2, …, with those of `changes`
    run: Mapped[RunRow] = relationship(lazy="joined", innerjoin=True)


class ChangeRow(Checked, Base):
    """A campaign, or one of its runs, came into another state."""

    __tablename__ = "changes"
    __table_args__ = (
        Index("changes_sequence", "campaign_number", "sequence", unique=True),
        {"sqlite_autoincrement": True},
    )

    number: Mapped[int] = mapped_column(primary_key=True)
    campaign_number: Mapped[int] = mapped_column(ForeignKey("campaigns.number"))
    run_id: Mapped[str | None]
    state: Mapped[str]
    reason: Mapped[str | None]
    at: Mapped[float]
    sequence: Mapped[int] = mapped_column(info=LATER)  # among the campaign's events: 1, 2, …, with those of `episodes`


class TriageRow(Checked, Base):
    """What people made of a contact."""

    __tablename__ = "triages"
    __table_args__ = (
        Index("triages_episodes", "campaign_number", "episode_number", unique=True),
        {"sqlite_autoincrement": True},
    )

    number: Mapped[int] = mapped_column(primary_key=True)
    campaign_number: Mapped[int] = mapped_column(ForeignKey("campaigns.number"))
    episode_number: Mapped[int] = mapped_column(ForeignKey("episodes.number"))
    state: Mapped[str]
    comment: Mapped[str] = mapped_column(Text)
    changed_at: Mapped[float]


class UsageRow(Checked, Base):
    """Worker time that a project has used in one hour since the epoch."""

    __tablename__ = "usage"

    project: Mapped[str] = mapped_column(primary_key=True)
    hour: Mapped[int] = mapped_column(primary_key=True)
    busy_s: Mapped[float]


class ServerRow(Checked, Base):
    """The one row that the server keeps of itself."""

    __tablename__ = "server"

    number: Mapped[int] = mapped_column(primary_key=True)
    cursor_secret: Mapped[str]  # 32 bytes, hexadecimal
    keys_made_at: Mapped[float | None]  # when the first API key was made, or seen; seconds since the epoch


def checksum(row: Checked) -> int:
    """CRC-32 of a row's columns but its own and the number that the database gives.

    A row from before a column was added keeps its checksum: such columns count only where one of them holds something,
    and the last ones only up to the last that is not null.
    """
    mapper = inspect(type(row))
    return checksum_of(_summed(mapper)(row), _added(mapper)(row))


def checksum_of(values: tuple[Any, ...], added: tuple[Any, ...]) -> int:
    """The same of values that are at hand: of the first columns, and of those that came later."""
    while added and added[-1] is None:
        added = added[:-1]
    return zlib.crc32(to_json((*values, *added) if any(added) else values, inf_nan_mode="strings"))


@cache
def _summed(mapper: Mapper[Any]) -> Callable[[Checked], tuple[Any, ...]]:
    return attrgetter(*summed_columns(mapper)[0])


@cache
def _added(mapper: Mapper[Any]) -> Callable[[Checked], tuple[Any, ...]]:
    names = summed_columns(mapper)[1]
    return lambda row: tuple(getattr(row, name) for name in names)


def summed_columns(mapper: Mapper[Any]) -> tuple[list[str], list[str]]:
    """Names of the columns that a checksum is formed over: those there were first, and those that came later."""
    names = [name for name in mapper.columns.keys() if name not in ("number", "checksum")]  # noqa: SIM118
    later = [name for name in names if mapper.columns[name].info]
    return [name for name in names if name not in later], later


@event.listens_for(Checked, "before_insert", propagate=True)
@event.listens_for(Checked, "before_update", propagate=True)
def _seal(mapper: Mapper[Any], connection: object, row: Checked) -> None:
    for name, column in mapper.columns.items():
        if getattr(row, name) is None and isinstance(column.default, ScalarElementColumnDefault):
            setattr(row, name, column.default.arg)  # else the INSERT would fill it in, after this
    row.checksum = checksum(row)


@event.listens_for(Checked, "load", propagate=True)
@event.listens_for(Checked, "refresh", propagate=True)
def _verify(row: Checked, *_: object) -> None:
    if row.checksum is not None and row.checksum != checksum(row):
        raise damaged(type(row), getattr(row, "id", None) or getattr(row, "number", ""))


def damaged(table: type[Checked], name: object) -> StorageError:
    """What to raise of a row whose checksum does not hold."""
    local = inspect(table).local_table.name
    return StorageError(f"row {name} of the table {local!r} is damaged; restore the database from a copy")
