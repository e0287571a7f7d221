"""Scenarios as the API and `risk-sac scenarios` return them."""

from collections.abc import Mapping
from datetime import datetime

from risk_sac.config import Scenario
from risk_sac.records.base import Record


class ScenarioCheck(Record):
    """Result of a check: scenes played without an attack."""

    name: str
    scenes: int
    """Drawn at random."""
    played: int
    refused: Mapping[str, int]
    """Scenes by the rule that refused them: `constraint`, `scenario` or a rule of C_hard."""
    contacts: int
    """Episodes in which the default ego touched something."""
    invalid: tuple[str, ...]
    """Why episodes did not end."""
    out_of_reach: tuple[str, ...]
    """Adversaries that can never come near the ego's way."""
    without_effect: tuple[str, ...]
    """Parameters that change no start, whatever their value."""
    seconds: float
    """Simulated time of all episodes."""
    remarks: tuple[str, ...] = ()
    """What is to be mended, one sentence each."""


class ScenarioParameterRow(Record):
    """A parameter of a scenario."""

    name: str
    unit: str
    meaning: str
    range: tuple[float, float] | None
    words: tuple[str, ...] | None


class ScenarioSummary(Record):
    """A scenario in a list."""

    name: str
    """That campaigns name it by."""
    shipped: bool
    created_at: datetime | None
    """Null of a shipped one."""
    summary: str
    tags: tuple[str, ...]
    parameters: list[ScenarioParameterRow]
    actors: list[str]
    horizon_s: float | str
    """A number, or arithmetic over parameters."""
    like: str | None
    """Shipped family whose prior fits."""
    episode_s: Mapping[str, float] = {}
    """Method → slot seconds of an episode, in lists: median over the newest runs."""


class ScenarioList(Record):
    """All scenarios: those that ship, then the project's own, newest first."""

    items: list[ScenarioSummary]


class ScenarioDetails(ScenarioSummary):
    """A scenario with its document."""

    document: str
    """As YAML."""


def summary_of(name: str, document: Scenario, created_at: datetime | None = None) -> ScenarioSummary:
    """Returns a scenario as lists show it; it ships unless it has a time."""
    return ScenarioSummary(
        name=name,
        shipped=created_at is None,
        created_at=created_at,
        summary=document.summary,
        tags=document.tags,
        parameters=[
            ScenarioParameterRow(name=key, unit=p.unit, meaning=p.meaning, range=p.range, words=p.words)
            for key, p in document.parameters.items()
        ],
        actors=list(document.actors),
        horizon_s=document.horizon_s,
        like=None if document.like is None else document.like.family,
    )
