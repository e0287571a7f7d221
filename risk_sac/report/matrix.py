"""Builds the coverage matrix of a campaign, and merges those of several.

Episodes of searches, frozen policies and the i.i.d. phase count alike: the matrix says what was played, never how often
something happens.
"""

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from risk_sac.config import CampaignSpec, FamilyName
from risk_sac.records import EpisodeRecord, Outcome
from risk_sac.records.assessment import (
    CellPower,
    CellState,
    CoverageCell,
    CoverageGroup,
    CoverageMatrix,
    CoverageRow,
    CoveredCampaign,
    CoveredPair,
)
from risk_sac.report import standards
from risk_sac.report.comparison import Comparison
from risk_sac.report.coverage import BINS, NOT_PLAYED, PAIR_BINS, Axis, axes_of
from risk_sac.report.statistics import BenchmarkRun, played_by, power_of
from risk_sac.scenario.bodies import BODIES
from risk_sac.scenario.families import family_named

LIMITS = (
    "A cell counts where episodes begin and of which scenario they are; what unfolds is in the taxonomy of contacts.",
    "Played without a failure is no proof of safety: power says what the budget behind it would have found.",
    "Power is that of the whole budget in the cell's scenarios, not of the cell.",
    "A failure is counted in each cell that its episode lies in; none of these values need have caused it.",
    "A value that the ODD allows beside others, and no scene parameter varies, is one cell with these: which one an "
    "episode had is not recorded.",
    "A functional scenario is what the document's tags say; no trajectory is classified.",
    "A requirement is reached where less than one scale of robustness was left; violations are those that count.",
)
TITLES: Mapping[str, tuple[str, str]] = {
    "odd": ("Operational design domain", standards.ISO_34503),
    "functional_scenarios": ("Functional scenarios", standards.ISO_34502),
    "tags": ("Tags of the scenarios", ""),
    "requirements": ("Requirements", ""),
    "traffic_rules": ("Traffic rules", "Convention on Road Traffic, Vienna 1968, by title"),
    "parameters": ("Scene parameters", ""),
    "bodies": ("Bodies", ""),
}
RULED = ("no_contact", *(rule.requirement for rule in standards.TRAFFIC_RULES if rule.requirement))
ROLES = ("ego", "adversary", "story", "background", "static")


@dataclass(slots=True)
class _Count:
    """Episodes of one cell."""

    played: int = 0
    failed: int = 0
    reached: int | None = None
    families: dict[str, None] = field(default_factory=dict)

    def add(self, family: str, *, failed: bool, reached: bool | None = None) -> None:
        self.played += 1
        self.failed += failed
        self.families[family] = None
        if reached is not None:
            self.reached = (self.reached or 0) + reached


def coverage_matrix(
    comparison: Comparison, id_: str = "", benchmark: Sequence[BenchmarkRun] | None = None
) -> CoverageMatrix:
    """Builds the matrix of the finished runs of one campaign.

    `id_` is the campaign's, or the first digits of its spec's digest; power follows from the benchmark's runs.
    """
    spec, id_ = comparison.spec, id_ or comparison.spec.digest[:12]
    counts: defaultdict[standards.CellKey, _Count] = defaultdict(_Count)
    axes: dict[FamilyName, list[Axis]] = {}
    pairs: list[CoveredPair] = []
    records: dict[FamilyName, list[EpisodeRecord]] = {}
    for run in (*comparison.runs, *comparison.drawn):
        records.setdefault(run.spec.family, []).extend(run.records)
    everything: list[EpisodeRecord] = []
    for family, of_family in records.items():
        facts, axes[family] = standards.SceneFacts(family, spec.odd), axes_of(family_named(family), spec.odd, BINS)
        names = {axis.parameter.name for axis in axes[family]}
        played = [one for one in of_family if one.outcome not in NOT_PLAYED and names <= one.scene.keys()]
        everything += played
        for record in played:
            failed = record.outcome is Outcome.FAILURE
            for key in (*sorted(facts.cells(record.scene)), *_bins(family, axes[family], record)):
                counts[key].add(family, failed=failed)
            _count_requirements(counts, family, record)
        pairs += _pairs(family, spec, played, id_)
    covered = CoveredCampaign(
        id=id_,
        label=spec.label,
        ego=spec.ego.name,
        families=spec.families,
        episodes=len(everything),
        failures=sum(record.outcome is Outcome.FAILURE for record in everything),
        complete=not comparison.missing and not comparison.undrawn,
    )
    power = {family: _power(comparison, family, id_, benchmark) for family in records}
    groups = tuple(_groups(counts, axes, id_, power))
    return _matrix((covered,), groups, tuple(pairs), definitions_of(everything))


def merged(matrices: Sequence[CoverageMatrix]) -> CoverageMatrix:
    """Merges campaigns' matrices cell by cell; parameters with unlike ranges stay apart."""
    if len(matrices) < 2:
        return matrices[0] if matrices else _matrix((), tuple(_groups({}, {}, "", {})), (), ())
    campaigns = tuple(campaign for matrix in matrices for campaign in matrix.campaigns)
    groups = [
        CoverageGroup(name=name, title=title, source=source, rows=tuple(_merged_rows(name, matrices)))
        for name, (title, source) in TITLES.items()
    ]
    pairs: dict[tuple[object, ...], CoveredPair] = {}
    for pair in (pair for matrix in matrices for pair in matrix.pairs):
        key = pair.family, pair.parameters, pair.bins
        pairs[key] = _both(pairs[key], pair) if key in pairs else pair
    definitions = sorted({version for matrix in matrices for version in matrix.definitions})
    return _matrix(campaigns, tuple(groups), tuple(pairs.values()), definitions)


def definitions_of(records: Sequence[EpisodeRecord]) -> tuple[int, ...]:
    """Returns the definition versions that contacts and violations were judged by."""
    contacts = {record.collision.judgement.definitions for record in records if record.collision is not None}
    return tuple(sorted(contacts | {violation.definitions for record in records for violation in record.violations}))


def _matrix(
    campaigns: tuple[CoveredCampaign, ...],
    groups: tuple[CoverageGroup, ...],
    pairs: tuple[CoveredPair, ...],
    definitions: Sequence[int],
) -> CoverageMatrix:
    states = [cell.state for group in groups for row in group.rows for cell in row.cells]
    cells = {state: states.count(state) for state in CellState}
    return CoverageMatrix(
        definitions=tuple(definitions), campaigns=campaigns, groups=groups, pairs=pairs, cells=cells, limits=LIMITS
    )


def _bins(family: str, axes: Sequence[Axis], record: EpisodeRecord) -> Iterator[standards.CellKey]:
    for axis in axes:
        place = axis.places(np.array([record.scene[axis.parameter.name]]))[0]
        yield standards.CellKey("parameters", axis.parameter.name, axis.names[place], family)


def _count_requirements(counts: Mapping[standards.CellKey, _Count], family: str, record: EpisodeRecord) -> None:
    for name, result in record.requirements.items():
        violated = name in record.failed if result.counts == "failure" else result.violated_s is not None
        counts[standards.CellKey("requirements", name, family)].add(
            family, failed=violated, reached=result.robustness < 1.0
        )


def _power(
    comparison: Comparison, family: FamilyName, id_: str, benchmark: Sequence[BenchmarkRun] | None
) -> CellPower | None:
    """Returns what the best method finds in a scenario; None if unmeasured."""
    spec = comparison.spec.model_copy(update={"families": (family,)})
    played = [one for one in played_by(comparison.runs) if one.family == family]
    methods = [one for one in power_of(spec, played, benchmark).methods if one.defects]
    if not methods:
        return None
    best = max(methods, key=lambda one: one.expected)
    return CellPower(campaign=id_, method=best.method, expected=best.expected, faults=len(best.defects))


def _groups(
    counts: Mapping[standards.CellKey, _Count],
    axes: Mapping[FamilyName, Sequence[Axis]],
    id_: str,
    power: Mapping[FamilyName, CellPower | None],
) -> Iterator[CoverageGroup]:
    def cells(group: str, row: str, names: Iterable[str], family: str = "") -> tuple[CoverageCell, ...]:
        """Cells of the names, then of others that were met."""
        met = [key.cell for key in counts if (key.group, key.row, key.family) == (group, row, family)]
        made = []
        for name in dict.fromkeys((*names, *met)):
            count = counts.get(standards.CellKey(group, row, name, family), _Count())
            measured = [one for one in map(power.get, count.families) if one is not None]
            best = max(measured, key=lambda one: one.expected, default=None)
            made.append(
                _cell(
                    name,
                    count,
                    campaigns=(id_,) if count.played else (),
                    failing=(id_,) if count.failed else (),
                    power=best,
                    unplayed="not asked there" if group == "requirements" else "never played",
                )
            )
        return tuple(made)

    requirements = dict.fromkeys((*RULED, *(key.row for key in counts if key.group == "requirements")))
    of_requirement = {name: cells("requirements", name, axes) for name in requirements}
    rows: dict[str, list[CoverageRow]] = {
        "odd": [
            CoverageRow(
                name=attribute.name,
                meaning=f"{attribute.branch}: {attribute.meaning}",
                unit=standards.UNITS.get(attribute.name, ""),
                cells=cells("odd", attribute.name, attribute.values)
                if attribute.values
                else (_inexpressible("any", attribute.meaning),),
            )
            for attribute in standards.ODD_ATTRIBUTES
        ],
        "functional_scenarios": [
            CoverageRow(
                name=f"{road}, {manoeuvre}",
                meaning=f"{road} road; the ego's manoeuvre is {manoeuvre}",
                cells=cells("functional_scenarios", f"{road}, {manoeuvre}", standards.BEHAVIOURS),
            )
            for road in standards.ROADS
            for manoeuvre in standards.MANOEUVRES
        ],
        "tags": [CoverageRow(name="tags", meaning="words of the documents", cells=cells("tags", "tags", ()))],
        "requirements": [
            CoverageRow(name=name, meaning="by scenario", cells=made) for name, made in of_requirement.items()
        ],
        "traffic_rules": [
            CoverageRow(
                name=rule.name,
                meaning=": ".join(part for part in (rule.requirement, rule.note) if part),
                cells=of_requirement.get(rule.requirement) or (_inexpressible("any", rule.note),),
            )
            for rule in standards.TRAFFIC_RULES
        ],
        "parameters": [
            CoverageRow(
                name=axis.parameter.name,
                meaning=axis.parameter.meaning,
                unit=axis.parameter.unit,
                family=family,
                cells=cells("parameters", axis.parameter.name, axis.names, family),
            )
            for family, of_family in axes.items()
            for axis in of_family
        ],
        "bodies": [
            CoverageRow(name=role, meaning="role of an actor", cells=cells("bodies", role, _bodies_of(role)))
            for role in ROLES
        ],
    }
    for name, (title, source) in TITLES.items():
        yield CoverageGroup(name=name, title=title, source=source, rows=tuple(rows[name]))


def _bodies_of(role: str) -> Iterator[str]:
    for name, body in BODIES.items():
        moving = "lanes" in body.moves if role in ("ego", "background") else body.moves != ("not",)
        if moving or role == "static":
            yield name


def _cell(
    name: str,
    count: _Count,
    *,
    campaigns: tuple[str, ...],
    failing: tuple[str, ...],
    power: CellPower | None,
    unplayed: str = "never played",
) -> CoverageCell:
    """Returns a cell with state and note (`unplayed` without an episode)."""
    played, failed, reached = count.played, count.failed, count.reached
    state = CellState.FAILED if failed else CellState.PLAYED if played else CellState.NEVER
    if reached == 0 and not failed:
        state = CellState.NEVER
    if state is CellState.NEVER:
        note = unplayed if reached is None else f"tried in {played}, never reached"
    elif state is CellState.FAILED:
        note = f"{failed} of {played} failed"
    elif power is None:
        note = "played, no failure, power: not measured"
    else:
        note = f"played, no failure, power: finds {power.expected:.3g} of {power.faults} known faults"
    return CoverageCell(
        name=name,
        state=state,
        played=played,
        failed=failed,
        reached=reached,
        families=tuple(count.families),
        campaigns=campaigns,
        failing=failing,
        power=power if state is CellState.PLAYED else None,
        note=note,
    )


def _inexpressible(name: str, why: str) -> CoverageCell:
    return CoverageCell(name=name, state=CellState.INEXPRESSIBLE, note=f"not expressible: {why}")


def _pairs(family: FamilyName, spec: CampaignSpec, played: Sequence[EpisodeRecord], id_: str) -> Iterator[CoveredPair]:
    axes = axes_of(family_named(family), spec.odd, PAIR_BINS)
    failed = np.array([record.outcome is Outcome.FAILURE for record in played], dtype=bool)
    columns = [np.array([record.scene[axis.parameter.name] for record in played], dtype=np.float64) for axis in axes]
    placed = [(axis, axis.places(column)) for axis, column in zip(axes, columns, strict=True)]
    for (one, rows), (other, others) in combinations(placed, 2):
        grids = [np.zeros((len(one.names), len(other.names)), dtype=np.int64) for _ in range(2)]
        np.add.at(grids[0], (rows, others), 1)
        np.add.at(grids[1], (rows[failed], others[failed]), 1)
        yield CoveredPair(
            family=family,
            parameters=(one.parameter.name, other.parameter.name),
            bins=(one.names, other.names),
            played=_as_tuples(grids[0]),
            failed=_as_tuples(grids[1]),
            campaigns=(id_,) if played else (),
        )


def _as_tuples(grid: NDArray[np.int64]) -> tuple[tuple[int, ...], ...]:
    return tuple(tuple(row) for row in grid.tolist())


def _both(one: CoveredPair, other: CoveredPair) -> CoveredPair:
    sums = {
        "played": _as_tuples(np.array(one.played) + np.array(other.played)),
        "failed": _as_tuples(np.array(one.failed) + np.array(other.failed)),
    }
    return one.model_copy(update=sums | {"campaigns": _union(one.campaigns, other.campaigns)})


def _merged_rows(group: str, matrices: Sequence[CoverageMatrix]) -> Iterator[CoverageRow]:
    rows: dict[tuple[object, ...], list[CoverageRow]] = {}
    for row in (row for matrix in matrices for one in matrix.groups if one.name == group for row in one.rows):
        bins = tuple(cell.name for cell in row.cells) if row.family else ()
        rows.setdefault((row.family, row.name, bins), []).append(row)
    for same in rows.values():
        cells: dict[str, list[CoverageCell]] = {}
        for cell in (cell for row in same for cell in row.cells):
            cells.setdefault(cell.name, []).append(cell)
        yield same[0].model_copy(update={"cells": tuple(map(_merged_cell, cells.values()))})


def _merged_cell(cells: Sequence[CoverageCell]) -> CoverageCell:
    if cells[0].state is CellState.INEXPRESSIBLE:
        return cells[0]
    reached = [cell.reached for cell in cells if cell.reached is not None]
    played, failed = sum(cell.played for cell in cells), sum(cell.failed for cell in cells)
    families = dict.fromkeys(name for cell in cells for name in cell.families)
    return _cell(
        cells[0].name,
        _Count(played, failed, sum(reached) if reached else None, families),
        campaigns=_union(*(cell.campaigns for cell in cells)),
        failing=_union(*(cell.failing for cell in cells)),
        power=max((cell.power for cell in cells if cell.power), key=lambda one: one.expected, default=None),
        unplayed=cells[0].note if cells[0].reached is None else "never played",
    )


def _union(*names: Iterable[str]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(name for some in names for name in some))
