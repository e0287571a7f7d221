"""The table of a campaign's failures. Pure.

Records are taken from their JSON without validation, because a table may have ten thousand of them.
"""

from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from operator import itemgetter
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
OF_RUN = {"run_ids": "id", "families": "family", "methods": "method", "seeds": "seed"}  # column -> field
OF_COLLISION = {
    **{"striker": "other_id", "striker_kind": "other_kind", "time_s": "time_s", "visible_for_s": "visible_for_s"},
    **{name: name for name in ("ego_speed_mps", "other_speed_mps", "relative_speed_mps", "lateral_offset_m")},
    **{name: name for name in ("min_rss_margin_m", "ego_peak_braking_mps2")},
}
OF_JUDGEMENT = ("signature", "grade", "conflict_type", "conflict_s", "hidden", "ego_response", "ground", "broke")
DECIDED = ("ids", "number", "indices", "phases", "valid", "distinct", "refused_by", "repeats")
EARLY = ("min_ttc_s", "min_robustness")
COLUMNS = (*OF_RUN, *OF_COLLISION, *OF_JUDGEMENT, *DECIDED, *EARLY, "name", "scene")
ROUNDED = (*(name for name in OF_COLLISION if not name.startswith("striker")), *EARLY, "conflict_s")
UNJUDGED: Plain = dict.fromkeys(OF_JUDGEMENT) | {"broke": []}

_of_collision, _of_judgement = itemgetter(*OF_COLLISION.values()), itemgetter(*OF_JUDGEMENT)

Columns = Mapping[str, Sequence[Any]]


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
    rows = [_row(runs[each.run_number], each, found[each.run_number, each.phase]) for each in contacts]
    columns: dict[str, Sequence[Any]] = dict.fromkeys(COLUMNS, ())
    columns |= zip(COLUMNS, zip(*rows, strict=True), strict=bool(rows))
    kinds = _kinds(columns)
    places = {kind.name: place for place, kind in enumerate(kinds)}
    noted = [triages.get(number, TriageState.NEW) for number in columns["number"]]
    made = {name: _rounded(columns[name]) for name in ROUNDED} | {
        "kind": [places[name] for name in columns["name"]],
        "kinds": kinds,
        "triage": noted,
        "scenes": _scenes(columns),
    }
    return FailureTable.model_validate(columns | made)


def _row(run: StoredRun, contact: PlainEpisode, found: Kinds) -> tuple[Any, ...]:
    """`COLUMNS`."""
    record = contact.record
    collision = record["collision"]
    repetition = run.repetitions.get(contact.index)
    valid = contact.outcome == Outcome.FAILURE
    return (
        *(run.id, run.family, run.method, run.seed),
        *_of_collision(collision),
        *_of_judgement(collision.get("judgement") or UNJUDGED),
        f"{run.id}-{contact.phase}-{contact.index}",
        contact.number,
        contact.index,
        contact.phase,
        valid,
        valid and found.add(collision),
        [rule for rule, passed in collision.get("verdicts", {}).items() if not passed],
        None if repetition is None else "verified" if repetition.verified else "flaky",
        *(collision.get(f"early_{name}", collision.get(name)) for name in EARLY),
        signature_of(collision),
        record["scene"],
    )


def _kinds(columns: Columns) -> list[FailureKind]:
    """Of the signatures, the most preventable failures first."""
    signatures = dict(zip(columns["name"], columns["signature"], strict=True))
    failures, distinct, preventable = Counter[str](), Counter[str](), Counter[str]()
    told = (columns[name] for name in ("name", "valid", "distinct", "grade"))
    for name, valid, first, grade in zip(*told, strict=True):
        failures[name] += valid
        distinct[name] += first
        preventable[name] += valid and grade == Grade.CAREFUL
    kinds = [
        FailureKind(
            signature=signature,
            name=name,
            failures=failures[name],
            distinct=distinct[name],
            preventable=preventable[name],
        )
        for name, signature in signatures.items()
    ]
    return sorted(kinds, key=lambda kind: (-kind.preventable, -kind.failures, kind.name))


def _scenes(columns: Columns) -> dict[str, FamilyScenes]:
    places: defaultdict[str, list[int]] = defaultdict(list)
    for place, family in enumerate(columns["families"]):
        places[family].append(place)
    scenes = columns["scene"]
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
