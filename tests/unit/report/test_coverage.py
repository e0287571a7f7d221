from dataclasses import replace

from risk_sac.config import Interval, Odd, RunSpec
from risk_sac.metrics import clopper_pearson
from risk_sac.records import Outcome
from risk_sac.report.coverage import axis_of, coverage, kinds
from risk_sac.report.document import drawn
from risk_sac.scenario.families import FAMILIES
from risk_sac.scenario.space import Parameter
from tests.builders import collision, episode_record, judgement

MIXED = FAMILIES["mixed"]
LOWEST = {parameter.name: parameter.low for parameter in MIXED.space.parameters}


def scene(outcome=Outcome.SAFE, contact=None, **values):
    return episode_record(0, outcome, scene=LOWEST | values, collision=contact)


def of(found, name):
    return next(each for each in found.parameters if each.name == name)


def test_a_bin_holds_its_lower_edge_and_the_last_one_both():
    length = Parameter("length_m", "m", 0, 10, "a length")
    axis = axis_of(length, length, 5)
    assert axis.names == ("0 to 2", "2 to 4", "4 to 6", "6 to 8", "8 to 10")
    assert axis.places([0.0, 1.999, 2.0, 7.9, 8.0, 10.0]).tolist() == [0, 0, 1, 3, 4, 4]
    fixed = Parameter("length_m", "m", 3, 3, "a length")
    assert axis_of(fixed, length, 5).names == ("3",)
    assert axis_of(fixed, length, 5).places([3.0]).tolist() == [0]


def test_what_was_played_failed_and_refused_in_each_bin_and_what_never_was():
    failed = scene(Outcome.FAILURE, collision(judgement=judgement()), crossing=0.7, friction=0.99)
    found = coverage(MIXED, Odd(), [scene(), scene(), failed, scene(Outcome.REJECTED, friction=0.8)])
    assert found.episodes == 3
    friction = of(found, "friction")
    assert [(each.played, each.failed, each.refused) for each in friction.bins if each.played or each.refused] == [
        (2, 0, 0),
        (0, 0, 1),
        (1, 1, 0),
    ]
    assert len(friction.never) == 8
    assert "0.8 to 0.84" in friction.never  # what is refused has not been looked at
    crossing = of(found, "crossing")
    assert crossing.categorical
    assert [(each.name, each.played, each.failed) for each in crossing.bins] == [("zebra", 2, 0), ("signalised", 1, 1)]


def test_bins_follow_the_odd_and_what_it_allows_beyond_scenes_is_named():
    odd = Odd.model_validate({"environment": {"friction": {"low": 0.8, "high": 0.9}}})
    found = coverage(MIXED, odd, [])
    assert (of(found, "friction").low, of(found, "friction").high) == (0.8, 0.9)
    assert "ego_speed_mps from 0 to 6 m/s" in found.beyond  # scenes begin at 6 m/s or faster
    assert "environment.visibility_m" in found.fixed
    assert "environment.friction" not in found.fixed
    assert MIXED.odd.dynamic.ego_speed_mps == Interval(low=0, high=13.89)


def test_cells_that_were_hit_are_in_words_and_values_that_never_were_are_named():
    contact = collision(judgement=judgement())
    found = kinds([contact, contact, None, collision(verdicts={"ego_moving": False}, judgement=judgement())])
    assert list(found.hit.values()) == [2]
    assert found.values["striker"]["vehicle (adversary)"] == 2
    assert "pedestrian (background)" in found.never
    assert "vehicle (adversary)" not in found.never
    assert all(name.startswith("vehicle (adversary), the ego") for name in found.hit)


SPEC = RunSpec.model_validate({"family": "low", "method": "iid-random", "seed": 3})


def run_of(finished, letters, crashed=0):
    """Run of an i.i.d. phase; in `crashed` refused scenes SUMO died."""
    run = finished(SPEC, letters)
    records = [record.model_copy(update={"phase": "iid"}) for record in run.records]
    refused = [place for place, record in enumerate(records) if record.outcome is Outcome.REJECTED]
    for place in refused[len(refused) - crashed :]:
        records[place] = records[place].model_copy(update={"reason": "sim_crash"})
    return replace(run, records=tuple(records))


def test_nothing_of_300_is_at_most_a_hundredth(finished):
    found = drawn(run_of(finished, "." * 300))
    assert (found.played, found.failures.count, found.failures.low) == (300, 0, 0.0)
    assert f"{100 * found.failures.high:.2f}" == "0.99"


def test_contacts_valid_and_preventable_failures_are_of_the_scenes_that_were_played(finished):
    found = drawn(run_of(finished, "....rfFad."))
    assert (found.scenes, found.refused, found.unended, found.played) == (10, 1, 0, 9)
    assert [each.count for each in (found.contacts, found.failures, found.preventable)] == [4, 2, 1]
    assert (found.failures.low, found.failures.high) == clopper_pearson(2, 9)


def test_each_requirement_has_bounds_of_its_own(finished):
    found = drawn(run_of(finished, "kkkkvvkr")).requirements
    assert {name: (each.counts, each.violated, each.bound.count) for name, each in found.items()} == {
        "no_contact": ("failure", 0, 0),
        "safe_ttc": ("report", 2, 2),
        "never_fast": ("failure", 2, 2),
    }
    bound = found["never_fast"].bound
    assert (bound.low, bound.high) == clopper_pearson(2, 7)
    assert found["no_contact"].bound.high == clopper_pearson(0, 7)[1]
    assert drawn(run_of(finished, "..f.")).requirements == {}  # from before they were counted


def test_a_crash_of_the_simulator_may_have_been_a_failure_or_none(finished):
    found = drawn(run_of(finished, "...frr", crashed=1))
    assert (found.refused, found.unended, found.played, found.failures.count) == (1, 1, 4, 1)
    assert found.failures.low == clopper_pearson(1, 5)[0]
    assert found.failures.high == clopper_pearson(2, 5)[1]


def test_an_ego_that_failed_to_drive_may_have_failed_or_not(finished):
    run = run_of(finished, "...f.")
    invalid = run.records[4].model_copy(update={"outcome": Outcome.INVALID, "reason": "ego_deadline"})
    found = drawn(replace(run, records=(*run.records[:4], invalid)))
    assert (found.refused, found.unended, found.played, found.failures.count) == (0, 1, 4, 1)
    assert (found.failures.low, found.failures.high) == (clopper_pearson(1, 5)[0], clopper_pearson(2, 5)[1])
