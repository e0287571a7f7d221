from dataclasses import replace

from risk_sac.config import RunSpec
from risk_sac.metrics import clopper_pearson
from risk_sac.records import Outcome
from risk_sac.report.evidence.gathered import drawn

SPEC = RunSpec.model_validate({"family": "low", "method": "iid-random", "seed": 3})


def run_of(finished, letters, crashed=0):
    """A run of an i.i.d. phase; in its last refused scenes the simulator died."""
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
