"""The table of a campaign's failures. Pure."""

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Literal

import numpy as np

from risk_sac.config import FamilyName, MethodName
from risk_sac.records import (
    Collision,
    ConflictType,
    DrivenBy,
    EpisodeRecord,
    Fault,
    Grade,
    Phase,
    PlausibilityClass,
    Real,
    Record,
    Severity,
    TriageState,
    Violation,
)
from risk_sac.scenario.families import density_of
from risk_sac.verdicts.distinct import DistinctFailures, variant_name
from service.store.stored import StoredCampaign, StoredRecord, StoredRun

Repeats = Literal["verified", "flaky"]
DECIMALS = 4
OF_ANY = ("time_s", "ego_speed_mps")
OF_CONTACT = (
    "visible_for_s",
    "other_speed_mps",
    "relative_speed_mps",
    "lateral_offset_m",
    "min_rss_margin_m",
    "ego_peak_braking_mps2",
)
OF_JUDGEMENT = (
    "grade",
    "severity",
    "injury_risk",
    "fault",
    "conflict_type",
    "conflict_s",
    "hidden",
    "ego_response",
    "ground",
    "broke",
    "ego_broke",
)
COUNTED = ("failures", "distinct", "preventable", "published")


class KindRow(Record):
    """The failures of one kind."""

    name: str
    """In words; what `kind=` of the failures takes."""
    requirement: str
    """That is violated; `no_contact` by a contact."""
    variants: int
    """Different ones among the valid failures, of all families."""
    failures: int
    """Valid ones, of all families."""
    distinct: int
    """The first of their kind in their run and phase; what two runs found alike counts twice."""
    preventable: int
    """Valid ones that a reference driver would have prevented."""
    published: int
    """Of these, those that R157, FSM or RSS would have prevented."""


class FamilyScenes(Record):
    """The scenes of one family's failures."""

    names: list[str]
    """Parameters of the scene, as `GET /v1/families` describes them."""
    rows: list[tuple[Real, ...]]
    """For each failure of the family the values of these."""
    of: list[int]
    """Which entries of the table the rows belong to, from 0."""


class FailureTable(Record):
    """Failures by columns: lists with an entry per failure, by arrival.

    An episode that violates several requirements is one failure. A violation for the headline names it, else a
    preventable one that is not minor, else a preventable one, else a contact, else the first.
    Numbers are rounded to four decimals; the failure itself has all of them. Times count from the adversaries' release.
    """

    ids: list[str]
    run_ids: list[str]
    families: list[FamilyName]
    methods: list[MethodName]
    seeds: list[int]
    indices: list[int]
    """0-based within the run."""
    phases: list[Phase]
    driven_by: list[DrivenBy | None]
    """What drove the adversaries; null: nothing did."""
    valid: list[bool]
    """Whether it has a violation that no rule refused; always, unless `tier=raw` was asked for."""
    requirement: list[str]
    """That the violation which names it violates; `no_contact` of a contact."""
    failed: list[list[str]]
    """All requirements that count and were validly violated."""
    grade: list[Grade | None]
    """Null where it is not valid."""
    plausibility: list[PlausibilityClass | None]
    """How likely road users do what the adversaries did; null like `grade`."""
    unlikely: list[str]
    """The least likely thing that an adversary did, in words; empty where there is none."""
    severity: list[Severity | None]
    """Null without contact."""
    weight: list[float]
    """Severity times plausibility, times the density of the scene, as a multiple of the uniform one, where its document
    declares distributions. Failures are ranked by it."""
    injury_risk: list[Real]
    """As in Judgement; null like `severity`."""
    fault: list[Fault | None]
    """Which party caused it; null like `grade`."""
    prevented_by: list[list[str]]
    """Reference drivers."""
    headline: list[bool]
    """Whether it is the first of a kind in the headline."""
    distinct: list[bool]
    """Whether one of its valid violations is the first of its kind in its run and phase."""
    kind: list[int]
    """Position in `kinds`."""
    variant: list[int | None]
    """Position in `variants`; null where it is not valid."""
    striker: list[str | None]
    """What touched the ego; without contact what the ego would have met soonest, if any."""
    striker_kind: list[str | None]
    """vehicle | pedestrian"""
    conflict_type: list[ConflictType | None]
    """Null without contact."""
    conflict_s: list[Real]
    """When the conflict began; negative before the release."""
    time_s: list[Real]
    """When they touched, or when the requirement was first violated."""
    visible_for_s: list[Real]
    """How long the ego had known of the striker; 0 if unseen."""
    ego_speed_mps: list[Real]
    other_speed_mps: list[Real]
    relative_speed_mps: list[Real]
    """The closing speed."""
    lateral_offset_m: list[Real]
    """The striker's centre across the ego's axis."""
    min_ttc_s: list[Real]
    """Until 1 s before the contact; null where there was none."""
    min_rss_margin_m: list[Real]
    min_robustness: list[Real]
    """Until 1 s before the contact; without contact, of the requirement that was violated."""
    ego_peak_braking_mps2: list[Real]
    hidden: list[bool | None]
    """As in Judgement, or at the violation."""
    ego_response: list[str | None]
    """none | late_braking | braking | standing | starting | accelerating"""
    ground: list[str | None]
    """lane | junction | crossing | beside_crossing"""
    broke: list[list[str]]
    """What the striker broke."""
    ego_broke: list[list[str]]
    """What the ego broke."""
    refused_by: list[list[str]]
    """Rules that the violation failed; none where it is valid."""
    repeats: list[Repeats | None]
    """Whether it was the same each time it was replayed; null where it was not."""
    triage: list[TriageState]
    """What people made of it; `new` at first."""
    kinds: list[KindRow]
    """The most preventable failures first, then the most failures."""
    variants: list[str]
    """What tells failures of one kind apart, in words; two kinds may have the same words."""
    scenes: Mapping[FamilyName, FamilyScenes]
    """By family, of those with a failure."""


def failure_table(
    campaign: StoredCampaign, failures: Iterable[StoredRecord], triages: Mapping[int, TriageState]
) -> FailureTable:
    """Returns the failures' table, in their order; untriaged ones are new."""
    runs = {run.number: run for run in campaign.runs}
    distinct: defaultdict[tuple[int, str], DistinctFailures] = defaultdict(DistinctFailures)
    headline, variants = DistinctFailures(), dict[str, int]()
    densities = {family: density_of(family) for family in {run.family for run in runs.values()}}
    failures, naming, rows = list(failures), list[Collision | Violation](), list[dict[str, Any]]()
    for failure in failures:
        worst, valid = failure.record.worst_violation, failure.record.valid_violations
        assert worst is not None  # else it would be no failure
        run = runs[failure.run_number]
        row = _row(run, failure.record, worst)
        row["weight"] = worst.weight(densities[run.family](failure.record.scene))
        kinds = distinct[failure.run_number, failure.record.phase]
        candidates = [each for each in valid if each.headline_candidate and row["repeats"] == "verified"]
        row["headline"] = sum(map(headline.add, candidates)) > 0
        row["distinct"] = sum(map(kinds.add, valid)) > 0
        row["variant"] = variants.setdefault(variant_name(worst), len(variants)) if valid else None
        naming.append(worst)
        rows.append(row)
    kind_rows = _kinds(naming, rows)
    places = {kind.name: place for place, kind in enumerate(kind_rows)}
    table: dict[str, Any] = {
        "kind": [places[worst.kind] for worst in naming],
        "kinds": kind_rows,
        "variants": [name.partition(" | ")[2] for name in variants],
        "triage": [triages.get(failure.number, TriageState.NEW) for failure in failures],
        "scenes": _scenes([row["families"] for row in rows], [failure.record.scene for failure in failures]),
    }
    for column in FailureTable.model_fields.keys() - table.keys():
        values = [row[column] for row in rows]
        table[column] = _rounded(values) if FailureTable.model_fields[column].annotation == list[Real] else values
    return FailureTable.model_validate(table)


def _row(run: StoredRun, record: EpisodeRecord, worst: Collision | Violation) -> dict[str, Any]:
    repetition = run.repetitions.get(record.index)
    row = {name: getattr(worst.judged, name, None) for name in OF_JUDGEMENT}
    if isinstance(worst, Violation):  # whose offences are the ego's own
        row |= {"broke": [], "ego_broke": worst.broke, "min_ttc_s": None, "min_robustness": worst.robustness}
    else:
        row |= {"min_ttc_s": worst.early_min_ttc_s, "min_robustness": worst.early_min_robustness}
    row |= {name: getattr(worst, name, None) for name in (*OF_ANY, *OF_CONTACT)}
    behaviour = worst.behaviour
    return row | {
        "plausibility": None if behaviour is None else behaviour.verdict,
        "unlikely": "" if behaviour is None else behaviour.sentence,
        "ids": record.id_in(run.id),
        "run_ids": run.id,
        "families": run.family,
        "methods": run.method,
        "seeds": run.seed,
        "indices": record.index,
        "phases": record.phase,
        "driven_by": record.driven_by,
        "valid": bool(record.valid_violations),
        "requirement": worst.requirement,
        "failed": [violation.requirement for violation in record.valid_violations],
        "striker": worst.other_id,
        "striker_kind": worst.other_kind,
        "prevented_by": [name for name, prevents in worst.prevention.items() if prevents],
        "refused_by": worst.broken,
        "repeats": None if repetition is None else "verified" if repetition.verified else "flaky",
    }


def _kinds(naming: Sequence[Collision | Violation], rows: Sequence[Mapping[str, Any]]) -> list[KindRow]:
    """Counts the failures of each kind, most preventable ones first."""
    kinds: dict[str, dict[str, Any]] = {}
    variants: defaultdict[str, set[int]] = defaultdict(set)
    for worst, row in zip(naming, rows, strict=True):
        kind = kinds.setdefault(worst.kind, {"requirement": worst.requirement} | dict.fromkeys(COUNTED, 0))
        kind["failures"] += row["valid"]
        kind["distinct"] += row["distinct"]
        kind["preventable"] += worst.preventable
        kind["published"] += worst.published_preventable
        if row["variant"] is not None:
            variants[worst.kind].add(row["variant"])
    found = [KindRow(name=name, variants=len(variants[name]), **kind) for name, kind in kinds.items()]
    return sorted(found, key=lambda kind: (-kind.preventable, -kind.failures, kind.name))


def _scenes(families: Sequence[str], scenes: Sequence[Mapping[str, float]]) -> dict[str, FamilyScenes]:
    places: defaultdict[str, list[int]] = defaultdict(list)
    for place, family in enumerate(families):
        places[family].append(place)
    return {family: _family_scenes([scenes[place] for place in of], of) for family, of in places.items()}


def _family_scenes(scenes: Sequence[Mapping[str, float]], of: list[int]) -> FamilyScenes:
    names = list(dict.fromkeys(name for scene in scenes for name in scene))
    parameters = [_rounded([scene.get(name) for scene in scenes]) for name in names]
    rows = list(zip(*parameters, strict=True)) or [()] * len(of)
    return FamilyScenes(names=names, rows=rows, of=of)


def _rounded(values: Sequence[Any]) -> list[Any]:
    """Numbers as they are shown; a missing one becomes NaN."""
    rounded: list[Any] = np.round(np.array(values, dtype=np.float64), DECIMALS).tolist()
    return rounded
