"""What a campaign has covered, cell by cell, and several campaigns together."""

import pytest

from risk_sac.config import CampaignSpec, Odd
from risk_sac.records import Outcome, RequirementResult
from risk_sac.records.assessment import CellState
from risk_sac.report import compare
from risk_sac.report.matrix import coverage_matrix, merged
from risk_sac.report.runs import FinishedRun
from risk_sac.report.standards import BEHAVIOURS, MANOEUVRES, ROADS, CellKey, Functional, SceneFacts, functional_of
from risk_sac.report.statistics import BenchmarkRun
from risk_sac.scenario.families import FAMILIES
from tests.builders import collision, episode_record, judgement

LOW = {parameter.name: parameter.low for parameter in FAMILIES["low"].space.parameters}
SPEC = CampaignSpec(families=("low",), methods=("random",), ego={"driver": "idm-aeb", "defects": ("latency",)})


def kept(robustness=0.5, **more):
    return {"no_contact": RequirementResult(counts="failure", robustness=robustness, violated_s=None), **more}


def played(*records, spec=SPEC):
    run = FinishedRun(spec=spec.runs()[0], digest="d", records=records, versions={}, wall_s=1.0, cpu_s=1.0)
    return compare(spec, [run], "")


def safe(**changes):
    return episode_record(0, Outcome.SAFE, scene=LOW | changes.pop("scene", {}), requirements=kept(), **changes)


def failed(**scene):
    contact = collision(judgement=judgement())
    broken = {"no_contact": RequirementResult(counts="failure", robustness=-0.1, violated_s=1.0)}
    return episode_record(
        1, Outcome.FAILURE, scene=LOW | scene, collision=contact, failed=("no_contact",), requirements=broken
    )


def cell(matrix, group, row, name, family=""):
    rows = next(one for one in matrix.groups if one.name == group).rows
    cells = next(one for one in rows if (one.name, one.family) == (row, family)).cells
    return next(one for one in cells if one.name == name)


def test_a_tag_names_a_functional_scenario_of_the_24():
    tags = ("iso34502:cut-in", "iso34502:merge/lane-change/deceleration", "iso34502:merge", "cut-in", "iso34502:a/b/c")
    assert list(functional_of(tags)) == [
        Functional("main", "lane-keep", "cut-in"),
        Functional("merge", "lane-change", "deceleration"),
    ]
    every = [f"iso34502:{road}/{ego}/{other}" for road in ROADS for ego in MANOEUVRES for other in BEHAVIOURS]
    assert len(set(functional_of(tuple(every)))) == 24


def test_a_cell_is_failed_played_never_or_inexpressible():
    matrix = coverage_matrix(played(safe(), safe(), failed(friction=0.95)), "c1")
    dry, wet = (cell(matrix, "odd", "surface friction", name) for name in ("0.9 to 1", "0.6 to 0.7"))
    assert (dry.state, dry.played, dry.failed, dry.failing) == (CellState.FAILED, 1, 1, ("c1",))
    assert (wet.state, wet.played, wet.failed, wet.campaigns) == (CellState.PLAYED, 2, 0, ("c1",))
    assert cell(matrix, "odd", "illumination", "night").state is CellState.NEVER
    assert cell(matrix, "odd", "wind", "any").state is CellState.INEXPRESSIBLE
    assert cell(matrix, "functional_scenarios", "main, lane-keep", "cut-in").played == 3
    assert cell(matrix, "functional_scenarios", "branch, lane-keep", "cut-in").state is CellState.NEVER
    assert sum(matrix.cells.values()) == sum(len(row.cells) for group in matrix.groups for row in group.rows)


def test_episodes_that_were_not_played_are_in_no_cell():
    refused = episode_record(2, Outcome.REJECTED, scene=LOW)
    matrix = coverage_matrix(played(safe(), refused, episode_record(3, Outcome.INVALID, scene=LOW)), "c1")
    assert matrix.campaigns[0].episodes == 1
    assert cell(matrix, "bodies", "ego", "car").played == 1


def test_finding_nothing_has_its_power_where_it_was_measured():
    benchmark = [
        BenchmarkRun(defect, "low", "random", 10_000, 10_000, 100, detected)
        for defect, detected in (("blind-left", 40), ("latency", None))
    ]
    measured = cell(coverage_matrix(played(safe(), failed(friction=0.95)), "c1", benchmark), "bodies", "ego", "car")
    assert measured.power is None  # an episode in it failed
    matrix = coverage_matrix(played(safe()), "c1", benchmark)
    power = cell(matrix, "bodies", "ego", "car").power
    assert (power.campaign, power.method, power.expected, power.faults) == ("c1", "random", 1.0, 2)
    assert cell(coverage_matrix(played(safe()), "c1", []), "bodies", "ego", "car").power is None


@pytest.mark.parametrize(
    ("robustness", "violated_s", "state"),
    [(1.2, None, CellState.NEVER), (0.4, None, CellState.PLAYED), (-0.2, 1.0, CellState.FAILED)],
)
def test_a_requirement_is_never_reached_kept_or_broken(robustness, violated_s, state):
    result = RequirementResult(counts="report", robustness=robustness, violated_s=violated_s)
    matrix = coverage_matrix(played(safe().model_copy(update={"requirements": {"rss_margin": result}})), "c1")
    assert cell(matrix, "requirements", "rss_margin", "low").state is state
    rule = cell(matrix, "traffic_rules", "keep a safe distance", "low")
    assert (rule.state, rule.played, rule.reached) == (state, 1, int(robustness < 1))
    assert cell(matrix, "traffic_rules", "stop at a stop sign", "any").state is CellState.INEXPRESSIBLE


def test_a_failure_of_a_counting_requirement_is_a_valid_one_alone():
    refused = RequirementResult(counts="failure", robustness=-0.1, violated_s=1.0)
    record = episode_record(0, Outcome.DEGENERATE, scene=LOW, requirements={"no_contact": refused})
    found = cell(coverage_matrix(played(record), "c1"), "requirements", "no_contact", "low")
    assert (found.state, found.failed) == (CellState.PLAYED, 0)


@pytest.mark.parametrize(("share", "body"), [(0.1, "car"), (0.5, "van"), (0.9, "truck")])
@pytest.mark.parametrize("side", [0.2, 0.8])
def test_a_word_of_a_scene_chooses_its_body_on_either_side(share, body, side):
    middle = {one.name: (one.low + one.high) / 2 for one in FAMILIES["motorway_cut_in"].space.parameters}
    cells = SceneFacts("motorway_cut_in", Odd()).cells(middle | {"cutter_body": share, "side": side})
    assert {key.cell for key in cells if (key.group, key.row) == ("bodies", "adversary")} == {"car", body}
    assert CellKey("odd", "motor vehicles", body) in cells


def test_a_crossing_tells_its_signal():
    middle = {one.name: (one.low + one.high) / 2 for one in FAMILIES["mixed"].space.parameters}
    facts = SceneFacts("mixed", Odd())
    for crossing, kind, signal in ((0.1, "zebra", "none"), (0.9, "signalised", "fixed_time")):
        cells = facts.cells(middle | {"crossing": crossing})
        assert {CellKey("odd", "pedestrian crossing", kind), CellKey("odd", "signals", signal)} <= cells


def test_campaigns_are_merged_cell_by_cell_and_named():
    one = coverage_matrix(played(safe(), safe()), "c1")
    other = coverage_matrix(played(failed()), "c2")
    both = merged([one, other])
    assert [campaign.id for campaign in both.campaigns] == ["c1", "c2"]
    found = cell(both, "bodies", "ego", "car")
    assert (found.state, found.played, found.failed) == (CellState.FAILED, 3, 1)
    assert (found.campaigns, found.failing) == (("c1", "c2"), ("c2",))
    assert sum(map(sum, both.pairs[0].played)) == 3
    assert both.pairs[0].campaigns == ("c1", "c2")
    assert merged([]).cells[CellState.PLAYED] == 0


def test_parameters_of_unlike_ranges_stay_apart():
    narrow = SPEC.model_copy(
        update={"odd": Odd.model_validate({"environment": {"friction": {"low": 0.6, "high": 0.8}}})}
    )
    both = merged([coverage_matrix(played(safe()), "c1"), coverage_matrix(played(safe(), spec=narrow), "c2")])
    rows = [row for group in both.groups if group.name == "parameters" for row in group.rows]
    assert [len([row for row in rows if row.name == name]) for name in ("friction", "lead_gap_m")] == [2, 1]
