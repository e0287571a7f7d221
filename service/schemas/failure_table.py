"""All failures of a campaign at once, for whoever sorts, filters and plots them."""

from collections.abc import Mapping
from typing import Literal

from risk_sac.config import FamilyName, MethodName
from risk_sac.records import ConflictType, Grade, Real, Record, TriageState

Repeats = Literal["verified", "flaky"]


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
    """What people made of it; `new` if nobody has."""
    kinds: list[FailureKind]
    """The most preventable failures first, then the most failures."""
    scenes: Mapping[FamilyName, FamilyScenes]
    """By family, of those with a failure."""
