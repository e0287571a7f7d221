"""Compares the versions of an ego over campaigns on equal terms. Pure.

Terms are all settings of a campaign but the ego, the label, and which seeds are drawn. Campaigns on other terms are in
another row. Within a row nothing is compared across a change of the definitions, the service or the simulator.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Annotated, Any

from pydantic import Field

from risk_sac.config import Budget, CampaignSpec, EgoConfig, Iid
from risk_sac.errors import ConfigError
from risk_sac.metrics import pooled_headline, pooled_published, pooled_requirements, wilson_interval
from risk_sac.records import Real, Record, RequirementCounts, RunMetrics
from risk_sac.records.rates import ANY, BoundaryMap, Rates

SOFTWARE = ("definitions", "risk-sac", "libsumo")
"""What results rest on beside the terms; a change of one of these ends a line."""
PUBLISHED = ("r157", "fsm")  # drivers that an ego's boundary is compared with
OF_EGO = {"profile", "driver", "label", "version"}  # the other fields of an ego are its settings


@dataclass(frozen=True, slots=True, kw_only=True)
class EndedRun:
    """A finished run of a campaign, with the fields of a trend."""

    family: str
    method: str
    iid: bool
    phases: tuple[RunMetrics, ...]  # search and evaluation, or the i.i.d. phase
    versions: Mapping[str, str]
    boundary: BoundaryMap | None = None  # of the method `boundary`
    rates: Rates | None = None  # of the method `rate`


@dataclass(frozen=True, slots=True, kw_only=True)
class EndedCampaign:
    """A campaign of which all runs have finished."""

    id: str
    spec: CampaignSpec
    runs: Sequence[EndedRun]
    at: datetime | None = None  # when it was posted


class TrendRate(Record):
    """Rate of an ego's failures in freshly drawn scenes.

    It is of one scenario and one kind of traffic.
    """

    family: str
    method: str
    """What draws: `iid-undisturbed` or `iid-random`; or `rate`, whose draws are weighted."""
    requirement: str | None
    """Null: any requirement that counts."""
    count: int
    """Episodes that violate it."""
    played: int
    """Episodes; refused scenes are none."""
    rate: Real
    low: Real
    """95 % interval: Wilson's, or that of weighted draws."""
    high: Real


class TrendArea(Record):
    """Share of a parameter box where the ego, not the driver, fails."""

    family: str
    parameters: tuple[str, ...]
    driver: str
    """The reference driver: `r157` or `fsm`."""
    rate: Real
    """The share."""
    low: Real
    """95 % interval from posterior samples of the boundary."""
    high: Real


class TrendPoint(Record):
    """Results of one ego version, from its newest campaign on these terms."""

    version: str
    """`ego.label`, else the registered version, else that of libsumo."""
    registered: str | None
    """Version of the registered ego and its defects, which ends in a hash of the source."""
    settings: tuple[str, ...]
    """Settings of the ego that differ from the defaults, such as `reaction_time_s 1`."""
    campaign_id: Annotated[str, Field(examples=["c27e3e7bd8296c1d3"])]
    """On the command line: its folder."""
    at: datetime | None
    """When it was posted."""
    earlier: tuple[str, ...]
    """Older campaigns of this version on the same terms, which do not count."""
    software: Annotated[Mapping[str, str], Field(examples=[{"definitions": "10", "libsumo": "1.28.0"}])]
    """What it was judged and played by; two versions where its runs differ."""
    changed: tuple[str, ...]
    """Names of `software` that differ from the version before. If there are any, no line leads here."""
    headline: int | None
    """Kinds of failures that are plausible, preventable, not minor and verified. Null before a replay."""
    headline_published: int | None
    """Of these kinds, those that R157, FSM or RSS prevents."""
    kinds: tuple[str, ...] | None
    """The headline kinds."""
    new: tuple[str, ...] | None
    """Kinds that no earlier version had. Null where there is nothing to compare with."""
    gone: tuple[str, ...] | None
    """Kinds of the version before that were not found again, which is no proof that they were mended."""
    returned: tuple[str, ...] | None
    """Kinds that the version before lacked and an earlier one had."""
    requirements: Mapping[str, RequirementCounts]
    """Requirement → its funnel, summed over the searches; its rate is one of a search."""
    rates: tuple[TrendRate, ...]
    """Of the i.i.d. phase and of the method `rate`; none without either."""
    areas: tuple[TrendArea, ...]
    """Of runs of the method `boundary`; none without one."""


class TrendRow(Record):
    """Versions of one ego on the same terms, oldest first."""

    ego: str
    """Registered name, or SUMO's profile."""
    families: tuple[str, ...]
    methods: tuple[str, ...]
    behaviour: str
    seeds: int
    """Number of seeds."""
    budget: Budget
    iid_episodes: int | None
    differs: tuple[str, ...]
    """Settings in which this row differs from the first one, such as `budget.episodes`."""
    points: tuple[TrendPoint, ...]


class LeftOut(Record):
    """A campaign that is in no row."""

    campaign_id: str
    reason: str


class Trend(Record):
    """An ego over its versions."""

    rows: tuple[TrendRow, ...]
    """Those with most versions first."""
    left_out: tuple[LeftOut, ...]
    """Campaigns that did not end well, or that this version of the service refuses."""


def driver_name(ego: EgoConfig) -> str:
    """Returns the name that an ego is listed by."""
    return ego.driver or ego.profile


def trend(campaigns: Sequence[EndedCampaign], left_out: Iterable[LeftOut] = ()) -> Trend:
    """Compares each ego's versions, placed by their first campaign, oldest first."""
    rows: dict[tuple[str, str], list[EndedCampaign]] = {}
    order: dict[tuple[str, str], int] = {}
    for campaign in campaigns:
        name = driver_name(campaign.spec.ego)
        order.setdefault((name, _version_key(campaign)), len(order))
        rows.setdefault((name, _terms(campaign.spec).model_dump_json()), []).append(campaign)
    found = [
        (sorted(of_row, key=lambda campaign: order[name, _version_key(campaign)]), name)
        for (name, _), of_row in rows.items()
    ]
    made = [(_row(name, of_row), _terms(of_row[0].spec)) for of_row, name in found]
    made.sort(key=lambda row: -len(row[0].points))  # stable: the oldest first among equals
    first = made[0][1] if made else None
    return Trend(
        rows=tuple(row.model_copy(update={"differs": tuple(_differing(first, terms))}) for row, terms in made),
        left_out=tuple(left_out),
    )


def check_scenarios(campaigns: Sequence[EndedCampaign]) -> None:
    """Raises a ConfigError if campaigns to compare differ in scenarios."""
    for campaign in campaigns[1:]:
        if set(campaign.spec.families) != set(campaigns[0].spec.families):
            differing = (f"{', '.join(sorted(each.spec.families))} in {each.id}" for each in (campaigns[0], campaign))
            raise ConfigError("campaign", " and ".join(differing), "campaigns of the same scenarios")


def _terms(spec: CampaignSpec) -> CampaignSpec:
    """Returns the spec without ego, label, `on_end`, list order and seed choice."""
    return spec.model_copy(
        update={
            "label": "",
            "on_end": None,
            "ego": EgoConfig(),
            "families": tuple(sorted(spec.families)),
            "methods": tuple(sorted(spec.methods)),
            "seeds": tuple(range(len(spec.seeds))),
            "iid": spec.iid and Iid(episodes=spec.iid.episodes),
        }
    )


def _version_key(campaign: EndedCampaign) -> str:
    return campaign.spec.ego.model_dump_json()


def _row(name: str, campaigns: Sequence[EndedCampaign]) -> TrendRow:
    spec = campaigns[0].spec
    by_version: dict[str, list[EndedCampaign]] = {}
    for campaign in campaigns:
        by_version.setdefault(_version_key(campaign), []).append(campaign)
    return TrendRow(
        ego=name,
        families=tuple(sorted(spec.families)),
        methods=tuple(sorted(spec.methods)),
        behaviour=spec.odd.dynamic.behaviour,
        seeds=len(spec.seeds),
        budget=spec.budget,
        iid_episodes=spec.iid and spec.iid.episodes,
        differs=(),
        points=tuple(_compared([_point(of_version) for of_version in by_version.values()])),
    )


def _point(campaigns: Sequence[EndedCampaign]) -> TrendPoint:
    """The newest campaign of a version, not compared yet."""
    newest = campaigns[-1]
    searched = [phase for run in newest.runs if not run.iid for phase in run.phases]
    software = {
        name: ", ".join(sorted({run.versions.get(name, "unknown") for run in newest.runs})) for name in SOFTWARE
    }
    replayed = [phase for phase in searched if phase.headline is not None]
    ego = newest.spec.ego
    return TrendPoint(
        version=ego.label or ego.version or f"libsumo {software['libsumo']}",
        registered=ego.version,
        settings=tuple(_settings(ego)),
        campaign_id=newest.id,
        at=newest.at,
        earlier=tuple(campaign.id for campaign in campaigns[:-1]),
        software=software,
        changed=(),
        headline=pooled_headline(searched),
        headline_published=pooled_published(searched),
        kinds=tuple(sorted({kind for phase in replayed for kind in phase.headline_kinds})) if replayed else None,
        new=None,
        gone=None,
        returned=None,
        requirements=pooled_requirements(searched),
        rates=(
            *(rate for run in newest.runs if run.iid for phase in run.phases for rate in _rates(run, phase)),
            *(rate for run in newest.runs if run.rates is not None for rate in _weighted(run, run.rates)),
        ),
        areas=tuple(area for run in newest.runs if run.boundary is not None for area in _areas(run.boundary)),
    )


def _compared(points: Sequence[TrendPoint]) -> Iterator[TrendPoint]:
    """Compares versions with earlier ones since the last change of software."""
    before: list[TrendPoint] = []
    for point in points:
        changed = tuple(
            name for name in SOFTWARE if before and before[-1].software[name] != point.software[name]
        )  # `before` is empty at the first point alone
        if changed:
            before = []
        changes: dict[str, Any] = {"changed": changed}
        if before and point.kinds is not None and before[-1].kinds is not None:
            now, last = set(point.kinds), set(before[-1].kinds)
            ever = {kind for earlier in before for kind in earlier.kinds or ()}
            changes |= {
                "new": tuple(sorted(now - ever)),
                "gone": tuple(sorted(last - now)),
                "returned": tuple(sorted((now & ever) - last)),
            }
        before.append(point)
        yield point.model_copy(update=changes)


def _rates(run: EndedRun, phase: RunMetrics) -> Iterator[TrendRate]:
    played = phase.rated - phase.rejected
    counted = {None: phase.failures} | {name: counts.in_rate for name, counts in phase.requirements.items()}
    for requirement, count in counted.items() if played else ():
        low, high = wilson_interval(count, played)
        yield TrendRate(
            family=run.family,
            method=run.method,
            requirement=requirement,
            count=count,
            played=played,
            rate=count / played,
            low=low,
            high=high,
        )


def _weighted(run: EndedRun, rates: Rates) -> Iterator[TrendRate]:
    """Rates from weighted draws, without those that were not estimated."""
    for name, estimate in rates.rates.items():
        if estimate.rate is not None and estimate.low is not None and estimate.high is not None:
            yield TrendRate(
                family=run.family,
                method=run.method,
                requirement=None if name == ANY else name,
                count=estimate.failures,
                played=rates.played,
                rate=estimate.rate,
                low=estimate.low,
                high=estimate.high,
            )


def _areas(boundary: BoundaryMap) -> Iterator[TrendArea]:
    for driver in boundary.maps:
        area = driver.ego_fails_alone
        if area is not None and driver.name in PUBLISHED:
            yield TrendArea(
                family=boundary.family,
                parameters=tuple(axis.name for axis in boundary.axes),
                driver=driver.name,
                rate=area.share,
                low=area.low,
                high=area.high,
            )


def _settings(ego: EgoConfig) -> Iterator[str]:
    """Yields an ego's settings that differ from its profile's defaults."""
    usual = dict(_flat(EgoConfig(profile=ego.profile).model_dump(mode="json")))
    filled_in = {"response_time_s"} if ego.driver else set()
    for name, value in _flat(ego.model_dump(mode="json", exclude=OF_EGO | filled_in)):
        if value != usual.get(name):
            yield f"{name} {', '.join(value) if isinstance(value, list) else value}"


def _differing(first: CampaignSpec | None, terms: CampaignSpec) -> Iterator[str]:
    if first is not None:
        usual, own = (dict(_flat(each.model_dump(mode="json"))) for each in (first, terms))
        yield from (name for name in usual | own if usual.get(name) != own.get(name))


def _flat(settings: Mapping[str, Any], within: str = "") -> Iterator[tuple[str, Any]]:
    """Yields each setting by its dotted path."""
    for name, value in settings.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{within}{name}.")
        else:
            yield f"{within}{name}", value
