"""Test cases of a campaign after ISO 34505."""

from dataclasses import replace

import pytest

from risk_sac.config import Requirement
from risk_sac.config.distribution import HistogramLaw, NormalLaw, WeightsLaw
from risk_sac.config.story import Story
from risk_sac.records import Outcome, TriageState
from risk_sac.report import compare
from risk_sac.report.document import CampaignEvidence, CampaignFacts, gathered
from risk_sac.report.reported_cases import _steps, law_in_words
from risk_sac.report.standards import CLAUSES
from risk_sac.scenario.families import document_named

CONTACT = Requirement(name="no_contact", formula="vehicle_gap_m > 0")
TTC = Requirement(name="safe_ttc", formula="encounter_s >= 1.5", counts="report")
FACTS = CampaignFacts(requirements={"low": (CONTACT, TTC)}, people={TriageState.CONFIRMED: 2})


@pytest.fixture
def case(spec, runs):
    (made,) = gathered(compare(spec, runs, ""), FACTS).cases
    return made


def test_a_case_names_its_scenario_platform_criteria_and_judges(case, spec):
    assert case.identifier == f"low-{spec.digest[:12]}"
    assert set(case.sources) == {"low.yaml", "low.net.xml"}
    assert case.functional_scenarios == ("main, lane-keep, cut-in", "main, lane-keep, deceleration")
    assert case.platform == {"numpy": "2.4"}
    assert case.pass_criteria == (CONTACT, TTC)
    assert case.judged_by.drivers == ("r157", "fsm", "rss", "defensive")
    assert case.judged_by.people == {TriageState.CONFIRMED: 2}
    assert case.odd["scenery.lanes"] == "3"
    friction = next(one for one in case.inputs if one.name == "friction")
    assert (friction.low, friction.high, friction.distribution, friction.declared) == (0.6, 1.0, "uniform", False)


@pytest.mark.parametrize(
    ("story", "begins"), [(Story(), "the scenario's story begins at once"), (None, "SUMO drives them for 1.5 s")]
)
def test_the_lead_in_is_that_of_the_scenario(spec, story, begins):
    document = document_named("low").model_copy(update={"story": story})
    assert list(_steps(spec, "low", document))[1] == f"Place all actors; {begins}."


def test_the_result_counts_the_searches_alone(case, runs):
    records = [record for run in runs for record in run.records]
    result = case.result
    assert (result.verdict, result.episodes, result.refused) == ("failed", len(records), 1)
    assert result.played + result.refused + result.unended == result.episodes
    assert result.failures == sum(record.outcome is Outcome.FAILURE for record in records)
    assert {run.id: run.episodes for run in case.recording} == {run.spec.id: 5 for run in runs}
    assert {run.digest for run in case.recording} == {run.digest for run in runs}


def test_an_episode_without_an_end_is_neither_played_nor_refused(spec, runs):
    first = runs[0].records[0].model_copy(update={"outcome": Outcome.REJECTED, "reason": "sim_crash"})
    second = runs[0].records[1].model_copy(update={"outcome": Outcome.INVALID, "reason": "ego_deadline"})
    some = [replace(runs[0], records=(first, second, *runs[0].records[2:])), *runs[1:]]
    (case,) = gathered(compare(spec, some, ""), FACTS).cases
    assert (case.result.unended, case.result.refused) == (2, 1)


def test_a_case_that_nothing_was_played_of_is_there_too(spec):
    (case,) = gathered(compare(spec, [], "")).cases
    assert (case.result.verdict, case.recording, case.result.headline) == ("not_played", (), None)


def test_a_violation_that_counts_is_a_valid_one(spec, finished):
    runs = [finished(run, "vkkv", ".") for run in spec.searches()[:1]]
    never_fast = Requirement(name="never_fast", formula="ego_speed_mps < 10")
    (case,) = gathered(compare(spec, runs, ""), CampaignFacts(requirements={"low": (never_fast, TTC)})).cases
    assert case.result.violated == {"never_fast": 2, "safe_ttc": 2}
    unjudged = tuple(record.model_copy(update={"failed": ()}) for record in runs[0].records)
    refused = [replace(runs[0], records=unjudged)]
    (case,) = gathered(compare(spec, refused, ""), CampaignFacts(requirements={"low": (never_fast, TTC)})).cases
    assert case.result.violated == {"never_fast": 0, "safe_ttc": 2}


def test_distributions_are_in_words():
    assert law_in_words(None) == "uniform"
    assert law_in_words(NormalLaw(kind="normal", mean=30, deviation=4)) == "normal, mean 30, deviation 4"
    assert law_in_words(WeightsLaw(kind="weights", weights=(1, 3))) == "weights 1, 3"
    bins = [{"low": 0, "high": 1, "weight": 2}]
    assert law_in_words(HistogramLaw.model_validate({"kind": "histogram", "bins": bins})) == "histogram of 1 bins"


def test_the_data_reads_back_and_its_schema_has_every_field_that_the_clauses_name(spec, runs):
    evidence = gathered(compare(spec, runs, ""), FACTS)
    assert CampaignEvidence.model_validate_json(evidence.model_dump_json()) == evidence
    fields = CampaignEvidence.model_json_schema(mode="serialization")["$defs"]["ReportedCase"]["required"]
    assert {row.field for row in CLAUSES} <= set(fields)
    assert {row.kind for row in evidence.figures} == {"count", "estimate", "model", "measurement"}
