import json

from pydantic_core import from_json

from risk_sac.config import CampaignSpec
from risk_sac.records import Grade, Outcome, Repetition, Severity, stored, wire
from risk_sac.verdicts.distinct import DistinctFailures
from service.store.stored import PlainEpisode
from service.views.failure_table import failure_table
from tests.builders import collision, episode_record, judgement

SPEC = CampaignSpec(families=("low",), methods=("random",), seeds=(3, 4))
FAILURE, REFUSED = Outcome.FAILURE, Outcome.DEGENERATE


def plain(run, index, hit, outcome=FAILURE, phase="search", **changes):
    record = episode_record(index, outcome, phase=phase, collision=hit, **changes)
    return PlainEpisode(1, run.number, phase, index, outcome, from_json(stored(record)))


def told(table):
    return json.loads(wire(table))


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
