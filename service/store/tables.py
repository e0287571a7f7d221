"""Tables: campaigns, runs and their requirements, episodes, changes, triages, usage, server.

Records of the method are stored as the JSON that the worker sent; what is filtered or counted has a column of its own.
Numbers are primary keys in order of arrival, so pages stay stable under insertion. `service.store.migrations` has the
history.
"""

from sqlalchemy import ForeignKey, Index, Text, text
from sqlalchemy.orm import DeclarativeBase, Mapped, attribute_keyed_dict, mapped_column, relationship

from risk_sac.metrics.tally import STEPS

# What is summed up over runs, per family, method and state.
TALLIED = (
    "episodes_done",
    "raw_collisions",
    "failures",
    "distinct_failures",
    "preventable",
    "distinct_preventable",
    "distinct_published",
    "headline_candidates",
    "implausible",
    "headline",
)

IMPORTED = "imported "  # begins the idempotency keys of imported campaigns; those that are posted have no space


def _of_judged(name: str, *columns: str) -> Index:
    """An index without the many episodes that violated nothing that counts."""
    judged = text(f"{columns[1]} IS NOT NULL")
    return Index(name, *columns, sqlite_where=judged, postgresql_where=judged)


class Base(DeclarativeBase):
    """Root of the mapped tables."""


class CampaignRow(Base):
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
    tags: Mapped[str | None]  # between commas: ",nightly,braking,"
    idempotency_key: Mapped[str | None]
    spec: Mapped[str] = mapped_column(Text)
    state: Mapped[str]
    reason: Mapped[str | None]
    created_at: Mapped[float]
    started_at: Mapped[float | None]
    finished_at: Mapped[float | None]
    revision: Mapped[int] = mapped_column(default=1)
    events: Mapped[int] = mapped_column(default=0)  # how many there are, which is the last one's sequence
    runs: Mapped[list["RunRow"]] = relationship(back_populates="campaign", order_by="RunRow.number")


class RunRow(Base):
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
    distinct_failures: Mapped[int] = mapped_column(default=0)
    preventable: Mapped[int] = mapped_column(default=0)
    distinct_preventable: Mapped[int] = mapped_column(default=0)
    distinct_published: Mapped[int] = mapped_column(default=0)
    headline_candidates: Mapped[int] = mapped_column(default=0)
    implausible: Mapped[int] = mapped_column(default=0)
    headline: Mapped[int | None]  # null before its failures were replayed
    busy_s: Mapped[float] = mapped_column(default=0.0)
    pace_s: Mapped[float | None]  # mean of its newest episodes; null before the second one
    attempts: Mapped[int] = mapped_column(default=0)
    processes: Mapped[int | None]  # that play its episodes; null before it starts, and in rows of older versions
    metrics: Mapped[str | None] = mapped_column(Text)
    evaluation: Mapped[str | None] = mapped_column(Text)
    digest: Mapped[str | None]
    versions: Mapped[str] = mapped_column(Text, default="{}")
    repetitions: Mapped[str | None] = mapped_column(Text)  # of its distinct failures, by episode's index
    campaign: Mapped[CampaignRow] = relationship(back_populates="runs")
    requirements: Mapped[dict[str, "RequirementRow"]] = relationship(
        collection_class=attribute_keyed_dict("name"), cascade="all, delete-orphan"
    )


class RequirementRow(Base):
    """The funnel of one requirement in one run, search and evaluation together."""

    __tablename__ = "requirements"
    __table_args__ = (Index("requirements_tallies", "name", *STEPS),)  # all that metrics sum up

    run_number: Mapped[int] = mapped_column(ForeignKey("runs.number"), primary_key=True)
    name: Mapped[str] = mapped_column(primary_key=True)
    violated: Mapped[int] = mapped_column(default=0)
    valid: Mapped[int] = mapped_column(default=0)
    distinct: Mapped[int] = mapped_column(default=0)
    preventable: Mapped[int] = mapped_column(default=0)
    published: Mapped[int] = mapped_column(default=0)


class EpisodeRow(Base):
    """Episode of a run; a resumed run's repeated report replaces it."""

    __tablename__ = "episodes"
    __table_args__ = (
        Index("episodes_ids", "run_number", "phase", "index", unique=True),
        Index("episodes_pages", "campaign_number", "number"),
        Index("episodes_sequence", "campaign_number", "sequence", unique=True),
        Index("episodes_runs", "run_number", "number"),
        Index("episodes_outcomes", "campaign_number", "outcome", "number"),
        *(_of_judged(f"episodes_{name}s", "campaign_number", name, "number") for name in ("grade", "kind")),
        {"sqlite_autoincrement": True},
    )

    number: Mapped[int] = mapped_column(primary_key=True)
    campaign_number: Mapped[int] = mapped_column(ForeignKey("campaigns.number"))
    run_number: Mapped[int] = mapped_column(ForeignKey("runs.number"))
    phase: Mapped[str]
    index: Mapped[int]
    outcome: Mapped[str]
    driven_by: Mapped[str | None]  # null where nothing drove, and of older records
    record: Mapped[str] = mapped_column(Text)
    series: Mapped[str | None]
    series_sha256: Mapped[str | None]
    wall_s: Mapped[float]
    violated: Mapped[str | None]  # requirements that were, between commas: ",safe_ttc,no_contact,"
    failed: Mapped[str | None]  # of these, those that make it a failure
    grade: Mapped[str | None]  # of a valid failure
    plausibility: Mapped[str | None]  # of a valid failure
    weight: Mapped[float | None]  # of a valid failure: severity times plausibility times density
    severity: Mapped[str | None]  # of its contact
    fault: Mapped[str | None]  # of a valid failure
    kind: Mapped[str | None]  # of the violation that names the episode
    broke: Mapped[str | None]  # what its striker broke, between commas: ",red_light,"
    funnel: Mapped[str | None] = mapped_column(Text)  # of the run's phase, this episode included
    sequence: Mapped[int]  # among the campaign's events: 1, 2, …, with those of `changes`
    run: Mapped[RunRow] = relationship(lazy="joined", innerjoin=True)


class ChangeRow(Base):
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
    sequence: Mapped[int]  # among the campaign's events: 1, 2, …, with those of `episodes`


class TriageRow(Base):
    """Triage of a failure by a person."""

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


class NoticeRow(Base):
    """The message that is due when a campaign ends."""

    __tablename__ = "notices"
    __table_args__ = (Index("notices_state", "state", "due_at"),)

    campaign_number: Mapped[int] = mapped_column(ForeignKey("campaigns.number"), primary_key=True)
    url: Mapped[str]
    link: Mapped[str]  # of the campaign
    state: Mapped[str] = mapped_column(default="waiting")
    tries: Mapped[int] = mapped_column(default=0)
    due_at: Mapped[float] = mapped_column(default=0.0)
    reason: Mapped[str | None] = mapped_column(Text)


class UsageRow(Base):
    """Worker time that a project used in one hour since the epoch."""

    __tablename__ = "usage"

    project: Mapped[str] = mapped_column(primary_key=True)
    hour: Mapped[int] = mapped_column(primary_key=True)
    busy_s: Mapped[float]


class ServerRow(Base):
    """The one row that the server keeps of itself."""

    __tablename__ = "server"

    number: Mapped[int] = mapped_column(primary_key=True)
    cursor_secret: Mapped[str]  # 32 bytes, hexadecimal
