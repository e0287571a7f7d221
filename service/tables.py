"""The database: campaigns, their runs, the runs' episodes.

Records of the method are stored as the JSON that the worker sent; what is filtered or counted has a
column of its own. Numbers are primary keys in order of arrival, so that a page continues where the
last one ended however much was inserted meanwhile.
"""

from sqlalchemy import ForeignKey, Index, Text, UniqueConstraint
from sqlalchemy.orm import DeclarativeBase, Mapped, mapped_column, relationship


class Base(DeclarativeBase):
    """Root of the mapped tables."""


class CampaignRow(Base):
    """A posted campaign."""

    __tablename__ = "campaigns"
    __table_args__ = {"sqlite_autoincrement": True}  # noqa: RUF012 - SQLAlchemy's own protocol

    number: Mapped[int] = mapped_column(primary_key=True)
    id: Mapped[str] = mapped_column(unique=True)
    spec: Mapped[str] = mapped_column(Text)
    state: Mapped[str]
    reason: Mapped[str | None]
    created_at: Mapped[float]
    started_at: Mapped[float | None]
    finished_at: Mapped[float | None]
    runs: Mapped[list["RunRow"]] = relationship(back_populates="campaign", order_by="RunRow.number")


class RunRow(Base):
    """One (family, method, seed) of a campaign."""

    __tablename__ = "runs"
    __table_args__ = (
        UniqueConstraint("campaign_number", "id"),
        Index("runs_queue", "state", "number"),
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
    busy_s: Mapped[float] = mapped_column(default=0.0)
    metrics: Mapped[str | None] = mapped_column(Text)
    evaluation: Mapped[str | None] = mapped_column(Text)
    digest: Mapped[str | None]
    versions: Mapped[str] = mapped_column(Text, default="{}")
    campaign: Mapped[CampaignRow] = relationship(back_populates="runs")


class EpisodeRow(Base):
    """One episode of a run; a resumed run may report it again, which replaces it."""

    __tablename__ = "episodes"
    __table_args__ = (
        UniqueConstraint("run_number", "phase", "index"),
        Index("episodes_pages", "campaign_number", "number"),
        Index("episodes_outcomes", "campaign_number", "outcome", "number"),
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
    wall_s: Mapped[float]
    run: Mapped[RunRow] = relationship(lazy="joined", innerjoin=True)
