"""The table of a campaign's failures. Pure.

Records are taken from their JSON without validation, because a table may have ten thousand of them.
"""

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Literal

import numpy as np

from risk_sac.config import FamilyName, MethodName
from risk_sac.records import ConflictType, Grade, Outcome, Real, Record, TriageState
from risk_sac.verdicts.distinct import Cell, cell
from service.store.stored import PlainEpisode, StoredCampaign, StoredRun

Plain = Mapping[str, Any]
"""A JSON object as it is stored, see `risk_sac.records.stored`."""
Repeats = Literal["verified", "flaky"]
DECIMALS = 4
OF_COLLISION = {"striker": "other_id", "striker_kind": "other_kind"} | {  # column -> field
    name: name
    for name in (
        "time_s",
        "visible_for_s",
        "ego_speed_mps",
        "other_speed_mps",
        "relative_speed_mps",
        "lateral_offset_m",
        "min_rss_margin_m",
        "ego_peak_braking_mps2",
    )
}
OF_JUDGEMENT = ("grade", "conflict_type", "conflict_s", "hidden", "ego_response", "ground", "broke")
COUNTED = ("failures", "distinct", "preventable")
UNJUDGED: Plain = dict.fromkeys((*OF_JUDGEMENT, "signature")) | {"broke": []}


class FailureKind(Record):
    """The failures of one signature."""

    signature: str | None
    """What `signature=` of the failures takes; null in what was stored before contacts were judged."""
    name: str
    """In words."""
    failures: int
    """Valid ones, of all families."""
    distinct: int
    """Those that are distinct in their run and phase; what two runs found alike counts twice."""
    preventable: int
    """Valid ones that the careful driver would have prevented."""


class FamilyScenes(Record):
    """The scenes of one family's failures."""

    names: list[str]
    """Parameters of the scene, as `GET /v1/families` describes them."""
    rows: list[tuple[Real, ...]]
    """For each failure of the family the values of these."""
    of: list[int]
    """Which entries of the table the rows belong to, from 0."""


class FailureTable(Record):
    """Failures by columns: each list has an entry per failure, in the order of their arrival.

    Numbers are rounded to four decimals; the failure itself has all of them. Times count from the adversaries' release.
    """

    ids: list[str]
    run_ids: list[str]
    families: list[FamilyName]
    methods: list[MethodName]
    seeds: list[int]
    indices: list[int]
    """0-based within the run."""
    phases: list[str]
    """train | evaluate"""
    valid: list[bool]
    """Whether no rule refused the contact; always, unless `tier=raw` was asked for."""
    grade: list[Grade | None]
    """Null where the contact is not valid, or was never judged."""
    distinct: list[bool]
    """Whether it is valid, and the first of its kind in its run and phase."""
    kind: list[int]
    """Position in `kinds`."""
    striker: list[str]
    striker_kind: list[str]
    """vehicle | pedestrian"""
    conflict_type: list[ConflictType | None]
    """Null in what was stored before contacts were judged, as all that is judged of a contact."""
    conflict_s: list[Real]
    """When the conflict began; negative before the release."""
    time_s: list[Real]
    """When they touched."""
    visible_for_s: list[Real]
    """How long the ego had known of the striker; 0 if unseen."""
    ego_speed_mps: list[Real]
    other_speed_mps: list[Real]
    relative_speed_mps: list[Real]
    lateral_offset_m: list[Real]
    """The striker's centre across the ego's axis."""
    min_ttc_s: list[Real]
    """Until 1 s before the contact; null where there was none."""
    min_rss_margin_m: list[Real]
    min_robustness: list[Real]
    """Soft minimum of the requirements, until 1 s before the contact."""
    ego_peak_braking_mps2: list[Real]
    hidden: list[bool | None]
    """Whether the ego knew nothing of the striker when the conflict began."""
    ego_response: list[str | None]
    """none | late_braking | braking | standing | starting"""
    ground: list[str | None]
    """lane | junction | crossing | beside_crossing"""
    broke: list[list[str]]
    """What the striker broke."""
    refused_by: list[list[str]]
    """Rules that the contact failed; none where it is valid."""
    repeats: list[Repeats | None]
    """Whether it was the same each time that it was played again; null where it was not."""
    triage: list[TriageState]
    """What people made of it; `new` at first."""
    kinds: list[FailureKind]
    """The most preventable failures first, then the most failures."""
    scenes: Mapping[FamilyName, FamilyScenes]
    """By family, of those with a failure."""


class Kinds:
    """Finds the first failure of each kind, as `risk_sac.verdicts.distinct.DistinctFailures` does."""

    def __init__(self) -> None:
        self._found: set[tuple[str, Cell]] = set()

    def add(self, collision: Plain) -> bool:
        """Adds a collision; returns whether it is the first of its kind."""
        niche = signature_of(collision), _cell(collision)
        new = niche not in self._found
        self._found.add(niche)
        return new


def signature_of(collision: Plain) -> str:
    """The judgement's signature; of a contact stored before contacts were judged, its striker."""
    judged = collision.get("judgement")
    if judged:
        return str(judged["signature"])
    return f"unjudged {collision['other_role']} {collision['other_kind']}"


def _cell(collision: Plain) -> Cell:
    judged = collision.get("judgement")
    from_conflict_s = float(collision["time_s"]) - float(judged["conflict_s"]) if judged else 0.0
    return cell((float(collision["ego_speed_mps"]), float(collision["other_speed_mps"]), from_conflict_s))


def failure_table(
    campaign: StoredCampaign, contacts: Iterable[PlainEpisode], triages: Mapping[int, TriageState]
) -> FailureTable:
    """The table of these contacts of the campaign, in their order; a contact without a triage is new."""
    runs = {run.number: run for run in campaign.runs}
    found: defaultdict[tuple[int, str], Kinds] = defaultdict(Kinds)
    contacts = list(contacts)
    rows = [_row(runs[each.run_number], each, found[each.run_number, each.phase]) for each in contacts]
    names = [signature_of(each.record["collision"]) for each in contacts]
    kinds = _kinds(contacts, names, rows)
    places = {kind.name: place for place, kind in enumerate(kinds)}
    table: dict[str, Any] = {
        "kind": [places[name] for name in names],
        "kinds": kinds,
        "triage": [triages.get(each.number, TriageState.NEW) for each in contacts],
        "scenes": _scenes([row["families"] for row in rows], [each.record["scene"] for each in contacts]),
    }
    for column in FailureTable.model_fields.keys() - table.keys():
        values = [row[column] for row in rows]
        table[column] = _rounded(values) if FailureTable.model_fields[column].annotation == list[Real] else values
    return FailureTable.model_validate(table)


def _row(run: StoredRun, contact: PlainEpisode, found: Kinds) -> dict[str, Any]:
    """A contact's entries of the columns."""
    collision = contact.record["collision"]
    judged = collision.get("judgement") or UNJUDGED
    repetition = run.repetitions.get(contact.index)
    valid = contact.outcome == Outcome.FAILURE
    row = {column: collision[name] for column, name in OF_COLLISION.items()}
    row |= {name: judged[name] for name in OF_JUDGEMENT}
    row |= {name: collision.get(f"early_{name}", collision.get(name)) for name in ("min_ttc_s", "min_robustness")}
    return row | {
        "ids": f"{run.id}-{contact.phase}-{contact.index}",
        "run_ids": run.id,
        "families": run.family,
        "methods": run.method,
        "seeds": run.seed,
        "indices": contact.index,
        "phases": contact.phase,
        "valid": valid,
        "distinct": valid and found.add(collision),
        "refused_by": [rule for rule, passed in collision.get("verdicts", {}).items() if not passed],
        "repeats": None if repetition is None else "verified" if repetition.verified else "flaky",
    }


def _kinds(contacts: Sequence[PlainEpisode], names: Sequence[str], rows: Sequence[Plain]) -> list[FailureKind]:
    """Of the signatures, the most preventable failures first."""
    kinds: dict[str, dict[str, Any]] = {}
    for contact, name, row in zip(contacts, names, rows, strict=True):
        judged = contact.record["collision"].get("judgement") or UNJUDGED
        kind = kinds.setdefault(name, {"signature": judged["signature"], "name": name} | dict.fromkeys(COUNTED, 0))
        kind["failures"] += row["valid"]
        kind["distinct"] += row["distinct"]
        kind["preventable"] += row["valid"] and row["grade"] == Grade.CAREFUL
    ordered = sorted(kinds.values(), key=lambda kind: (-kind["preventable"], -kind["failures"], kind["name"]))
    return [FailureKind(**kind) for kind in ordered]


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
