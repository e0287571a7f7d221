"""Catalogues: families, methods, formats, egos."""

from collections.abc import Mapping
from hashlib import blake2b
from typing import Annotated, Literal, TypeVar, get_args

from fastapi import APIRouter, Query, Request, Response
from pydantic import BaseModel, Field

from risk_sac.config import (
    Behaviour,
    DynamicElements,
    EgoConfig,
    FamilyName,
    Method,
    MethodName,
    Odd,
    Requirement,
    method_of,
)
from risk_sac.config.ego import EgoName
from risk_sac.config.methods import named_methods
from risk_sac.egos.defects.catalogue import DEFECTS, DefectKind
from risk_sac.egos.registry import cards
from risk_sac.failures.export.formats import FORMATS, FormatName
from risk_sac.records import Record, wire
from risk_sac.report.trend import Trend
from risk_sac.risk.requirements import SIGNALS, requirements_from_odd
from risk_sac.scenario.families import FAMILIES
from risk_sac.scenario.limits import behaving
from risk_sac.scenario.odd import widest
from service.api.answer_cache import kept
from service.api.context import CurrentCaller, Service
from service.api.pages import INVALID, TAGGED, UNKNOWN, entity_tag
from service.views.reports import trend_of

R = TypeVar("R", bound=BaseModel)

EPISODE_COST: Mapping[str, float] = {
    "risk-sac-diverse": 1.0,  # in `low` 1.6 over 60 episodes, elsewhere as a script
    "risk-sac-pretrained": 5.6,
    "archive": 0.7,
    "archive-replay": 0.7,
    "random": 1.0,
    "risk-sac": 9.0,
    "risk-sac-only-rper": 9.0,
    "risk-sac-only-rs": 9.0,
    "sac-lag": 9.0,
    "sac": 9.0,
    "sb3-sac": 14.0,
    "ast-sac": 30.0,
    "ast-ppo": 3.0,
    "ddpg-lag": 8.5,
    "ddpg": 8.5,
    "bo-only": 1.3,
    "no-adversary": 0.7,
    "story-sweep": 0.7,
    "story-random": 0.7,
    "story-bo": 1.1,
    "boundary": 3.0,
    "iid-random": 1.0,
    "rate": 0.7,
    "iid-undisturbed": 0.7,
}
"""Processor time of an episode as a multiple of `random`'s 0.06 s; of a learner, after its warm start.

Measured in `low` with seed 0 over 100 to 250 episodes; the SAC variants and `ddpg` by the first ten episodes after
their warm start; `sb3-sac` beside `sac`, at 1.5 times its time of a step and 1.6 of an episode.
"""


class SceneParameter(Record):
    """One dimension of a family's scene space."""

    name: str
    unit: str
    low: float
    high: float
    meaning: str
    odd: str | None
    """The field of the ODD that narrows it, such as `dynamic.ego_speed_mps`."""


class FamilyEntry(Record):
    """A scenario family: what is searched, and where."""

    name: FamilyName
    summary: str
    horizon_steps: int
    """Length of an episode in control steps of 0.1 s."""
    parameters: list[SceneParameter]
    adversaries: list[str]
    odd: Odd
    """Default operational design domain; a campaign's own narrows it."""
    behaviours: dict[Behaviour, DynamicElements]
    """The default's dynamic elements under each behaviour of a campaign's ODD."""
    odd_limits: Odd
    """How far a campaign's own may go: a few fields may be wider than the default, as far as this."""
    requirements: list[Requirement]
    """What the default ego has to meet in the default ODD. A campaign's ODD and ego change the thresholds; its own
    requirements come on top."""


class SignalEntry(Record):
    """Signal that formulas may use, with a value in every step."""

    name: str
    unit: str
    low: float
    high: float
    meaning: str


class ExportFormat(Record):
    """A format of other tools."""

    name: FormatName
    title: str
    what: str
    of: Literal["failure", "episodes"]
    """What it holds: one failure, or all episodes of runs."""
    suffix: str
    """Of what is downloaded."""
    media_type: str
    missing: list[str]
    """Packages that are not installed here, without which it cannot be made."""


class ExportFormats(Record):
    """All of them."""

    items: list[ExportFormat]


class Families(Record):
    """All scenario families, and what requirements may speak of in each."""

    items: list[FamilyEntry]
    signals: list[SignalEntry]


class NamedMethod(Method):
    """A search method."""

    name: MethodName
    usual: bool
    """Whether most campaigns need it; the others are for comparisons."""
    episode_cost: float | None
    """Processor time of an episode in `low`, as a multiple of one of `random`; of a learner, after its warm start. Null
    where it was not measured."""


class EgoDrivers(Record):
    """Drivers of the ego."""

    name: str
    """Of kind sumo: what `ego.profile` of a campaign takes; else what `ego.driver` does."""
    kind: Literal["sumo", "python", "remote"]
    """sumo: SUMO's models; python: in the worker's own process; remote: in a process of the operator's."""
    version: str | None
    """A campaign keeps it, and its runs go on with no other; null of SUMO's models, whose version is libsumo's."""
    response_time_s: float
    """Within which it responds to a danger, s; requirements follow from it."""
    deadline_s: float | None
    """For each of its answers, s; an episode in which it misses it is invalid."""
    summary: str


class DefectEntry(Record):
    """A known fault that `ego.defects` of a campaign plants into its ego."""

    name: str
    kind: DefectKind
    """sumo: for SUMO's driver; the others: for egos of kind python."""
    sentence: str
    """What the ego does wrong."""
    families: list[str]
    """In which it matters."""


class Egos(Record):
    """All egos; the operator registers them."""

    items: list[EgoDrivers]
    defects: list[DefectEntry]


class Methods(Record):
    """All search methods, the usual ones first."""

    items: list[NamedMethod]


PROFILES = {
    "default": "SUMO's default driver, with a driver's delay and a driver's view.",
    "perfect": "The same, that reacts within a step and sees everything.",
    "careful": "The default, with the braking of UN R157's driver on top.",
    "defensive": "The default, held back by the defensive reference driver.",
}
USUAL: tuple[MethodName, ...] = ("risk-sac-diverse", "archive", "random")
"""Methods that most campaigns need: the two that find most for their time, and the control."""
router = APIRouter(prefix="/v1", tags=["catalogue"])


@router.get("/families")
def list_families() -> Families:
    """Scenario families, and the signals that formulas speak of."""
    items = [
        FamilyEntry(
            name=family.name,
            summary=family.summary,
            horizon_steps=family.horizon_steps,
            parameters=[_told(SceneParameter, parameter) for parameter in family.space.parameters],
            adversaries=list(family.adversaries),
            odd=family.odd,
            behaviours={each: behaving(family.odd.dynamic, each) for each in get_args(Behaviour)},
            odd_limits=widest(family.odd),
            requirements=list(requirements_from_odd(family.odd, EgoConfig().response_s)),
        )
        for family in FAMILIES.values()
    ]
    return Families(items=items, signals=[_told(SignalEntry, signal, name=name) for name, signal in SIGNALS.items()])


@router.get("/formats")
def list_formats() -> ExportFormats:
    """Formats that failures and episodes can be exported in."""
    return ExportFormats(items=[_told(ExportFormat, row, name=name) for name, row in FORMATS.items()])


@router.get("/egos")
def list_egos() -> Egos:
    """Drivers of the ego: SUMO's profiles and registered egos; and known faults."""
    models = [
        EgoDrivers(
            name=name,
            kind="sumo",
            version=None,
            response_time_s=EgoConfig.model_validate({"profile": name}).response_s,
            deadline_s=None,
            summary=summary,
        )
        for name, summary in PROFILES.items()
    ]
    defects = [_told(DefectEntry, defect) for defect in DEFECTS.values()]
    return Egos(items=[*models, *(_told(EgoDrivers, card) for card in cards())], defects=defects)


@router.get("/egos/{name}/trend", response_model=Trend, responses=TAGGED | INVALID | UNKNOWN)
def get_trend(
    name: EgoName,
    request: Request,
    service: Service,
    caller: CurrentCaller,
    campaign: Annotated[
        list[Annotated[str, Field(max_length=100)]] | None,
        Query(max_length=50, description="Only these campaigns, all of the same scenarios; none: all of the ego."),
    ] = None,
) -> Response:
    """Versions of an ego: headline kinds, rates and requirements, on equal terms."""
    revision = service.store.revision_of_all()
    body = wire(trend_of(service.store, service.settings, name, campaign or (), caller.sees))
    headers = {"Cache-Control": "no-cache", "ETag": entity_tag(blake2b(body, digest_size=8).hexdigest())}
    return kept(request, body, headers, revision)


@router.get("/methods")
def list_methods() -> Methods:
    """Search methods, with what an episode of each costs."""
    names = [*USUAL, *(name for name in named_methods() if name not in USUAL)]
    return Methods(items=[_method(name) for name in names])


def _method(name: MethodName) -> NamedMethod:
    return _told(NamedMethod, method_of(name), name=name, usual=name in USUAL, episode_cost=EPISODE_COST.get(name))


def _told(record: type[R], row: object, **named: object) -> R:
    """Returns the record of a table's row; `named`: fields that it lacks."""
    said = {name: getattr(row, name) for name in record.model_fields.keys() - named.keys()}
    return record.model_validate(said | named)
