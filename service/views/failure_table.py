"""Table of a campaign's failures. Pure.

Records are taken from their JSON without validation, because a table may have ten thousand of them.
"""

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Literal

import numpy as np

from risk_sac.config import FamilyName, MethodName
from risk_sac.records import (
    NO_CONTACT,
    ConflictType,
    DrivenBy,
    Fault,
    Grade,
    Outcome,
    Phase,
    Real,
    Record,
    Severity,
    TriageState,
)
from risk_sac.verdicts.distinct import Niche, cell
from service.store.stored import PlainEpisode, StoredCampaign, StoredRun

Plain = Mapping[str, Any]
"""A JSON object as it is stored, see `risk_sac.records.stored`."""
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
COUNTED = ("failures", "distinct", "preventable")
UNJUDGED: Plain = dict.fromkeys((*OF_JUDGEMENT, "signature")) | {"broke": [], "ego_broke": []}


class KindRow(Record):
    """The failures of one signature."""

    signature: str | None
    """What `signature=` of the failures takes; null in what was stored before contacts were judged."""
    requirement: str
    """That is violated; `no_contact` by a contact."""
    name: str
    """In words."""
    failures: int
    """Valid ones, of all families."""
    distinct: int
    """Those that are distinct in their run and phase; what two runs found alike counts twice."""
    preventable: int
    """Valid ones that a reference driver would have prevented."""


class FamilyScenes(Record):
    """The scenes of one family's failures."""

    names: list[str]
    """Parameters of the scene, as `GET /v1/families` describes them."""
    rows: list[tuple[Real, ...]]
    """For each failure of the family the values of these."""
    of: list[int]
    """Which entries of the table the rows belong to, from 0."""


class FailureTable(Record):
    """Failures by columns: each list has an entry per failure, in order of arrival.

    An episode that violates several requirements is one failure; a contact names it, or else the first violation.
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
    """Null where it is not valid, or was never judged."""
    severity: list[Severity | None]
    """Null without contact, or where it was never judged."""
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
    niche: list[int | None]
    """Which distinct failure of the campaign it is, counted from 0 over all runs; null where it is not valid."""
    kind: list[int]
    """Position in `kinds`."""
    striker: list[str | None]
    """What touched the ego; without contact what the ego would have met soonest, if any."""
    striker_kind: list[str | None]
    """vehicle | pedestrian"""
    conflict_type: list[ConflictType | None]
    """Null without contact, and where that was never judged."""
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
    scenes: Mapping[FamilyName, FamilyScenes]
    """By family, of those with a failure."""


class KindIndex:
    """Finds the first failure of each kind, as `risk_sac.verdicts.distinct.DistinctFailures` does."""

    def __init__(self) -> None:
        self._found: set[Niche] = set()

    def add(self, violation: Plain) -> bool:
        """Adds a violation; returns whether it is the first of its kind."""
        niche = _niche(violation)
        new = niche not in self._found
        self._found.add(niche)
        return new


def violations_of(outcome: str, record: Plain) -> tuple[list[Plain], list[Plain]]:
    """Returns the valid violations of an episode, and all; a contact first."""
    contact = record["collision"]
    every = [*([] if contact is None else [contact]), *record.get("violations", [])]
    if outcome != Outcome.FAILURE:
        return [], every
    return [each for each in every if all(each.get("verdicts", {}).values())], every


def is_preventable(violation: Plain) -> bool:
    """Whether a reference driver would have prevented a valid violation."""
    return bool(_judged(violation)["grade"] == Grade.PREVENTABLE)


def prevented_by(violation: Plain) -> list[str]:
    """The reference drivers that would have prevented it."""
    drivers: Plain = _judged(violation).get("drivers", {})
    return [name for name, each in drivers.items() if (each["avoids"] if isinstance(each, Mapping) else each)]


def is_headline_candidate(violation: Plain) -> bool:
    """Whether a valid violation is preventable, and no minor contact."""
    grave = "requirement" in violation or _judged(violation).get("severity") in (Severity.MODERATE, Severity.SEVERE)
    return grave and is_preventable(violation)


def _judged(violation: Plain) -> Plain:
    """Returns the verdicts of a violation; those of a contact are nested."""
    if "requirement" in violation:
        return violation
    return violation.get("judgement") or UNJUDGED


def _requirement(violation: Plain) -> str:
    return str(violation.get("requirement", NO_CONTACT))


def _name(violation: Plain) -> str:
    """Its signature; of a contact stored before contacts were judged, its striker."""
    return _judged(violation)["signature"] or f"unjudged {violation['other_role']} {violation['other_kind']}"


def _niche(violation: Plain) -> Niche:
    values = [violation["ego_speed_mps"]]
    if "requirement" not in violation:
        judged = violation.get("judgement")
        from_conflict_s = float(violation["time_s"]) - float(judged["conflict_s"]) if judged else 0.0
        values += [violation["other_speed_mps"], from_conflict_s]
    return _requirement(violation), _name(violation), cell([float(value) for value in values])


def failure_table(
    campaign: StoredCampaign, failures: Iterable[PlainEpisode], triages: Mapping[int, TriageState]
) -> FailureTable:
    """Returns the table of these failures in their order; one without a triage is new."""
    runs = {run.number: run for run in campaign.runs}
    kinds_by_phase: defaultdict[tuple[int, str], KindIndex] = defaultdict(KindIndex)
    headline, niches = KindIndex(), dict[Niche, int]()
    failures, naming, rows = list(failures), [], []
    for failure in failures:
        valid, every = violations_of(failure.outcome, failure.record)
        naming.append(next(iter(valid or every)))
        kinds = kinds_by_phase[failure.run_number, failure.phase]
        row = _row(runs[failure.run_number], failure, naming[-1])
        candidates = filter(is_headline_candidate, valid if row["repeats"] == "verified" else [])
        rows.append(
            row
            | {"failed": [_requirement(violation) for violation in valid]}
            | {"headline": sum(map(headline.add, candidates)) > 0}
            | {"distinct": sum(map(kinds.add, valid)) > 0}
            | {"niche": niches.setdefault(_niche(naming[-1]), len(niches)) if valid else None}
        )
    kinds_found = _kinds(naming, rows)
    places = {(kind.requirement, kind.name): place for place, kind in enumerate(kinds_found)}
    table: dict[str, Any] = {
        "kind": [places[_requirement(each), _name(each)] for each in naming],
        "kinds": kinds_found,
        "triage": [triages.get(each.number, TriageState.NEW) for each in failures],
        "scenes": _scenes([row["families"] for row in rows], [each.record["scene"] for each in failures]),
    }
    for column in FailureTable.model_fields.keys() - table.keys():
        values = [row[column] for row in rows]
        table[column] = _rounded(values) if FailureTable.model_fields[column].annotation == list[Real] else values
    return FailureTable.model_validate(table)


def _row(run: StoredRun, failure: PlainEpisode, violation: Plain) -> dict[str, Any]:
    """A failure's entries of most columns, by the violation that names it."""
    judged = {**UNJUDGED, **_judged(violation)}
    repetition = run.repetitions.get(failure.index)
    row = {name: judged.get(name) for name in OF_JUDGEMENT}
    if "requirement" in violation:  # whose offences are the ego's own
        row |= {"broke": [], "ego_broke": violation["broke"]}
        row |= {"min_ttc_s": None, "min_robustness": violation["robustness"]}
    else:
        row |= {name: violation.get(f"early_{name}") for name in ("min_ttc_s", "min_robustness")}
    row |= {name: violation[name] for name in OF_ANY} | {name: violation.get(name) for name in OF_CONTACT}
    return row | {
        "ids": f"{run.id}-{failure.phase}-{failure.index}",
        "run_ids": run.id,
        "families": run.family,
        "methods": run.method,
        "seeds": run.seed,
        "indices": failure.index,
        "phases": failure.phase,
        "driven_by": failure.record.get("driven_by"),
        "valid": failure.outcome == Outcome.FAILURE,
        "requirement": _requirement(violation),
        "striker": violation["other_id"],
        "striker_kind": violation["other_kind"],
        "prevented_by": prevented_by(violation),
        "refused_by": [rule for rule, passed in violation.get("verdicts", {}).items() if not passed],
        "repeats": None if repetition is None else "verified" if repetition.verified else "flaky",
    }


def _kinds(naming: Sequence[Plain], rows: Sequence[Plain]) -> list[KindRow]:
    """Of the signatures, the most preventable failures first."""
    kinds: dict[tuple[str, str], dict[str, Any]] = {}
    for violation, row in zip(naming, rows, strict=True):
        key = requirement, name = row["requirement"], _name(violation)
        said = {"signature": _judged(violation)["signature"], "requirement": requirement, "name": name}
        kind = kinds.setdefault(key, said | dict.fromkeys(COUNTED, 0))
        kind["failures"] += row["valid"]
        kind["distinct"] += row["distinct"]
        kind["preventable"] += row["valid"] and row["grade"] == Grade.PREVENTABLE
    ordered = sorted(kinds.values(), key=lambda kind: (-kind["preventable"], -kind["failures"], kind["name"]))
    return [KindRow(**kind) for kind in ordered]


def _scenes(families: Sequence[str], scenes: Sequence[Plain]) -> dict[str, FamilyScenes]:
    places: defaultdict[str, list[int]] = defaultdict(list)
    for place, family in enumerate(families):
        places[family].append(place)
    return {family: _family_scenes([scenes[place] for place in of], of) for family, of in places.items()}


def _family_scenes(scenes: Sequence[Plain], of: list[int]) -> FamilyScenes:
    names = list(dict.fromkeys(name for scene in scenes for name in scene))  # those of an earlier version too
    parameters = [_rounded([scene.get(name) for scene in scenes]) for name in names]
    rows = list(zip(*parameters, strict=True)) or [()] * len(of)
    return FamilyScenes(names=names, rows=rows, of=of)


def _rounded(values: Sequence[Any]) -> list[Any]:
    """Numbers as they are shown; a missing one becomes NaN."""
    rounded: list[Any] = np.round(np.array(values, dtype=np.float64), DECIMALS).tolist()
    return rounded
