import json
import math
from dataclasses import replace

from pydantic_core import from_json

from risk_sac.config import CampaignSpec
from risk_sac.records import Grade, Outcome, Repetition, Severity, TriageState, stored, wire
from risk_sac.verdicts.distinct import DistinctFailures
from service.store.stored import PlainEpisode
from service.views.failure_table import failure_table
from tests.builders import collision, episode_record, judgement, violation

SPEC = CampaignSpec(families=("low",), methods=("random",), seeds=(3, 4))
FAILURE, REFUSED = Outcome.FAILURE, Outcome.DEGENERATE


def plain(run, index, hit, outcome=FAILURE, phase="search", **changes):
    record = episode_record(index, outcome, phase=phase, collision=hit, **changes)
    return PlainEpisode(1, run.number, phase, index, outcome, from_json(stored(record)))


def told(table):
    return json.loads(wire(table))


def test_a_column_has_what_the_record_has(ledger):
    campaign = ledger.create(SPEC)
    run = campaign.runs[1]
    hit = collision(
        time_s=3.21987654,
        early_min_ttc_s=math.inf,
        early_min_robustness=-0.123456,
        ego_speed_mps=math.nan,
        verdicts={"inside_limits": True, "ego_moving": False},
        judgement=judgement(None, conflict_s=-math.inf, severity=Severity.SEVERE, injury_risk=0.0123456, drivers={}),
    )
    table = told(
        failure_table(campaign, [plain(run, 7, hit, REFUSED, scene={"lead_gap_m": 12.34567}, driven_by="script")], {})
    )
    kinds, scenes = table.pop("kinds"), table.pop("scenes")
    assert {name: values[0] for name, values in table.items()} == {
        "ids": "low-random-4-search-7",
        "run_ids": "low-random-4",
        "families": "low",
        "methods": "random",
        "seeds": 4,
        "indices": 7,
        "phases": "search",
        "valid": False,
        "requirement": "no_contact",
        "failed": [],
        "grade": None,
        "severity": "severe",
        "injury_risk": 0.0123,
        "fault": None,
        "prevented_by": [],
        "headline": False,
        "distinct": False,
        "niche": None,
        "driven_by": "script",
        "kind": 0,
        "striker": "lead",
        "striker_kind": "vehicle",
        "conflict_type": "cut_in",
        "conflict_s": None,
        "time_s": 3.2199,
        "visible_for_s": 3.0,
        "ego_speed_mps": None,
        "other_speed_mps": 2.0,
        "relative_speed_mps": 7.0,
        "lateral_offset_m": 0.1,
        "min_ttc_s": None,
        "min_rss_margin_m": -3.0,
        "min_robustness": -0.1235,
        "ego_peak_braking_mps2": 4.5,
        "hidden": False,
        "ego_response": "late_braking",
        "ground": "lane",
        "broke": ["red_light", "speeding"],
        "ego_broke": [],
        "refused_by": ["ego_moving"],
        "repeats": None,
        "triage": "new",
    }
    named = {"signature": "cut-in, straight", "requirement": "no_contact", "name": "cut-in, straight"}
    assert kinds == [named | {"failures": 0, "distinct": 0, "preventable": 0}]
    assert scenes == {"low": {"names": ["lead_gap_m"], "rows": [[12.3457]], "of": [0]}}


def test_distinct_are_those_that_the_run_counted(ledger):
    campaign = ledger.create(SPEC)
    first, second = campaign.runs
    hits = [
        collision(judgement=judgement(), ego_speed_mps=5.0),
        collision(judgement=judgement(), ego_speed_mps=6.0),
        collision(judgement=judgement(), ego_speed_mps=9.0),
        collision(judgement=judgement(Grade.FULL_BRAKING, signature="leader"), ego_speed_mps=9.0),
        collision(judgement=judgement(conflict_s=0.5), ego_speed_mps=9.0),
        collision(),
    ]
    contacts = [plain(first, index, hit) for index, hit in enumerate(hits)]
    contacts += [
        plain(second, 0, hits[0]),
        plain(first, 9, hits[0], phase="evaluation"),
        plain(first, 10, hits[0], phase="evaluation"),
    ]
    counted = DistinctFailures()
    table = failure_table(campaign, contacts, {})
    assert table.prevented_by[2:6] == [["r157", "bound"], ["bound"], ["r157", "bound"], []]
    assert table.distinct == [*(counted.add(hit) for hit in hits), True, True, False]
    assert table.distinct[:6] == [True, False, True, True, True, True]
    assert [(kind.name, kind.failures, kind.distinct, kind.preventable) for kind in table.kinds] == [
        ("cut-in, straight", 7, 5, 7),
        ("leader", 1, 1, 0),
        ("unjudged adversary vehicle", 1, 1, 0),
    ]
    assert [kind.signature for kind in table.kinds] == ["cut-in, straight", "leader", None]
    assert table.kind == [0, 0, 0, 1, 0, 2, 0, 0, 0]
    assert (table.grade[5], table.conflict_type[5], table.hidden[5], table.broke[5]) == (None, None, None, [])


def test_a_violation_without_contact_has_what_is_known_of_it(ledger):
    campaign = ledger.create(SPEC)
    fast = violation(grade=Grade.PREVENTABLE, broke=("speeding",))
    near = violation(other_id="lead", other_kind="vehicle", other_role="adversary", ego_speed_mps=3.0)
    hit, touched = collision(verdicts={"ego_moving": False}), collision(judgement=judgement())
    other = violation(requirement="gap", signature="gap")
    episodes = [(None, (fast,)), (hit, (near,)), (touched, (near, other)), (None, (fast,))]
    failures = [
        plain(campaign.runs[0], index, contact, violations=violations, scene={})
        for index, (contact, violations) in enumerate(episodes)
    ]
    table = failure_table(campaign, failures, {})
    assert table.requirement == ["never_fast", "never_fast", "no_contact", "never_fast"]
    assert table.failed == [["never_fast"], ["never_fast"], ["no_contact", "never_fast", "gap"], ["never_fast"]]
    assert (table.striker, table.striker_kind) == ([None, "lead", "lead", None], [None, "vehicle", "vehicle", None])
    assert (table.time_s[0], table.ego_speed_mps[0], table.min_robustness[0]) == (1.5, 9.0, -0.4)
    assert (table.broke[0], table.ego_broke[0], table.refused_by[0]) == ([], ["speeding"], [])
    assert table.conflict_type[0] is None
    assert all(math.isnan(column[0]) for column in (table.conflict_s, table.other_speed_mps, table.min_rss_margin_m))
    assert table.distinct == [True, True, True, False]
    assert [(kind.requirement, kind.name, kind.failures, kind.distinct, kind.preventable) for kind in table.kinds] == [
        ("never_fast", "never_fast violated; straight", 3, 2, 2),
        ("no_contact", "cut-in, straight", 1, 1, 1),
    ]


def test_a_failure_says_whether_it_repeats(ledger):
    campaign = ledger.create(SPEC)
    run = campaign.runs[0]
    repetitions = {0: Repetition(times=3, same=3), 1: Repetition(times=3, same=2)}
    run = run.model_copy(update={"repetitions": repetitions})
    campaign = campaign.model_copy(update={"runs": (run, campaign.runs[1])})
    table = failure_table(campaign, [plain(run, index, collision()) for index in range(3)], {})
    assert table.repeats == ["verified", "flaky", None]


def test_what_people_made_of_a_contact_stands_beside_it(ledger):
    campaign = ledger.create(SPEC)
    contacts = [replace(plain(campaign.runs[0], index, collision()), number=index + 5) for index in range(3)]
    assert failure_table(campaign, contacts, {6: TriageState.FIXED, 9: TriageState.DISMISSED}).triage == [
        TriageState.NEW,
        TriageState.FIXED,
        TriageState.NEW,
    ]


def test_without_a_failure_the_table_is_empty(ledger):
    table = failure_table(ledger.create(SPEC), [], {})
    assert {name: len(values) for name, values in table} == dict.fromkeys(type(table).model_fields, 0)


def test_scenes_of_a_family_have_all_parameters_that_one_of_them_has(ledger):
    campaign = ledger.create(CampaignSpec(families=("low", "dense"), methods=("random",)))
    low, dense = campaign.runs
    scenes = [(low, {"gap": 1.0}), (dense, {}), (low, {"gap": 2.0, "friction": 0.5})]
    table = told(failure_table(campaign, [plain(run, 0, collision(), scene=scene) for run, scene in scenes], {}))
    assert table["scenes"] == {
        "low": {"names": ["gap", "friction"], "rows": [[1.0, None], [2.0, 0.5]], "of": [0, 2]},
        "dense": {"names": [], "rows": [[]], "of": [1]},
    }


def test_the_headline_has_the_first_of_a_kind_over_all_runs_that_is_not_minor_and_repeats(ledger):
    campaign = ledger.create(SPEC)
    first, second = (
        run.model_copy(update={"repetitions": {index: Repetition(times=2, same=2) for index in (0, 1, 3)}})
        for run in campaign.runs
    )
    searched = campaign.model_copy(update={"runs": (first, second)})
    minor, grave = (collision(judgement=judgement(severity=each)) for each in (Severity.MINOR, Severity.SEVERE))
    other = collision(judgement=judgement(signature="leader"))
    hits = [(first, 0, minor), (first, 1, grave), (first, 2, other), (second, 0, grave), (second, 3, other)]
    found = told(failure_table(searched, [plain(*each) for each in hits], {}))
    assert list(zip(found["severity"], found["headline"], strict=True)) == [
        ("minor", False),
        ("severe", True),
        ("moderate", False),  # not replayed
        ("severe", False),  # as in the other run
        ("moderate", True),
    ]


def test_what_two_runs_found_alike_is_one_failure_of_the_campaign(ledger):
    campaign = ledger.create(SPEC)
    first, second = campaign.runs
    slow, other = collision(ego_speed_mps=2.0), collision(judgement=judgement(signature="leader"))
    hits = [(first, 0, collision()), (first, 1, slow), (second, 0, collision()), (second, 1, other)]
    assert failure_table(campaign, [plain(*each) for each in hits], {}).niche == [0, 1, 0, 2]
