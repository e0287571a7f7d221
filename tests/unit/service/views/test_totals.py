"""Totals, curves and headline of a campaign, and scene parameters' effects."""

import itertools
import json
import random

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import mannwhitneyu

from risk_sac.config import CampaignSpec
from risk_sac.metrics import MetricsAccumulator
from risk_sac.records import Grade, Outcome, Repetition, Severity, State, wire
from service.store.stored import StoredRecord
from service.views.curves import curves, results, scene_effects, spread
from service.views.failure_table import failure_table
from service.views.progress import progress
from tests.begun import BEGUN as RUN
from tests.builders import LOW_SCENE, collision, episode_record, judgement, violation


def changed(record, **fields):
    return record.model_copy(update=fields)


def test_what_two_methods_found_alike_counts_once_in_the_campaign_and_once_for_each(ledger, metrics):
    campaign = ledger.create(CampaignSpec(families=("low",), methods=("sac", "random"), seeds=(0, 1)))
    found = {("sac", 0): ("a", "b"), ("sac", 1): ("b",), ("random", 0): ("b", "c"), ("random", 1): None}
    runs = []
    for run in campaign.runs:
        kinds = found[run.method, run.seed]
        told = {} if kinds is None else {"headline": len(kinds), "headline_kinds": kinds}
        runs.append(changed(run, metrics=metrics.model_copy(update=told)))
    searched = changed(campaign, runs=tuple(runs))
    assert {total.method: total.headline for total in results(searched).totals} == {"sac": 2, "random": 2}
    assert results(searched).headline == progress(searched, 1).headline == 3


SPEC = CampaignSpec(families=("low",), methods=("random",), seeds=(3, 4))


def plain(run, record):
    return StoredRecord(1, run.number, record)


def drawn(count):
    """Yields random records of a search: contacts of several kinds, and violations."""
    dice = random.Random(5)
    for index in range(count):
        outcome = dice.choice([Outcome.SAFE, Outcome.REJECTED, Outcome.FAILURE, Outcome.FAILURE, Outcome.DEGENERATE])
        kind = dice.choice("abcdefgh")
        grades = [Grade.UNAVOIDABLE] if kind == "h" else list(Grade)
        hit = collision(judgement=judgement(dice.choice(grades) if outcome is Outcome.FAILURE else None, kind=kind))
        touched = outcome in (Outcome.FAILURE, Outcome.DEGENERATE)
        if outcome is Outcome.DEGENERATE:
            hit = hit.model_copy(update={"verdicts": {"ego_moving": False}})
        more = {"mean_cost": dice.random(), "dual_variable": dice.random()}
        if outcome is Outcome.FAILURE and dice.random() < 0.4:
            more["violations"] = (violation(grade=dice.choice(list(Grade)), kind=dice.choice("wxyz")),)
            touched = dice.random() < 0.5
        yield episode_record(index, outcome, collision=hit if touched else None, **more)


def test_curves_are_what_the_metrics_of_the_run_were_at_each_point(ledger):
    campaign = ledger.create(SPEC)
    records = list(drawn(250))
    told, accumulator = [], MetricsAccumulator(horizon_steps=200)
    for record in records:
        told.append(accumulator.add(record))
    found, empty = curves(campaign, [plain(campaign.runs[0], each) for each in records], 40).runs
    assert len(found.episodes) == 40
    assert found.episodes[-1] == 250
    at = [told[count - 1] for count in found.episodes]
    for name in ("window_ecr", "window_pcr", "preventable", "distinct_preventable", "dual_variable"):
        assert getattr(found, name) == pytest.approx([getattr(each, name) for each in at]), name
    assert found.distinct == [each.distinct_failures for each in at]
    assert found.distinct[-1] > found.distinct_preventable[-1] > 3
    assert (found.run_id, found.family, found.method, found.seed) == ("low-random-3", "low", "random", 3)
    assert [value for _, value in empty if isinstance(value, list)] == [[]] * 8


@given(count=st.integers(1, 3000), points=st.integers(1, 1000))
def test_points_are_evenly_spread_and_the_newest_is_one(count, points):
    at = spread(count, points).tolist()
    assert len(at) == min(count, points)
    assert at[-1] == count
    gaps = [later - earlier for earlier, later in zip([0, *at], at, strict=False)]
    assert min(gaps) >= 1
    assert max(gaps) - min(gaps) <= 1


FAILURE = Outcome.FAILURE


def plain_failure(run, index, hit, outcome=FAILURE, phase="search", **changes):
    record = episode_record(index, outcome, phase=phase, collision=hit, **changes)
    return StoredRecord(1, run.number, record)


def told(table):
    return json.loads(wire(table))


def test_the_headline_has_the_first_of_a_kind_over_all_runs_that_is_not_minor_and_repeats(ledger):
    campaign = ledger.create(SPEC)
    first, second = (
        run.model_copy(update={"repetitions": {index: Repetition(times=2, same=2) for index in (0, 1, 3)}})
        for run in campaign.runs
    )
    searched = campaign.model_copy(update={"runs": (first, second)})
    minor, grave = (collision(judgement=judgement(severity=each)) for each in (Severity.MINOR, Severity.SEVERE))
    other = collision(judgement=judgement(kind="leader"))
    hits = [(first, 0, minor), (first, 1, grave), (first, 2, other), (second, 0, grave), (second, 3, other)]
    found = told(failure_table(searched, [plain_failure(*each) for each in hits], {}))
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
    slow, other = (collision(judgement=judgement(**each)) for each in ({"variant": "slow"}, {"kind": "leader"}))
    hits = [(first, 0, collision()), (first, 1, slow), (second, 0, collision()), (second, 1, other)]
    found = failure_table(campaign, [plain_failure(*each) for each in hits], {})
    assert (found.variant, found.variants) == ([0, 1, 0, 2], ["ahead", "slow", "ahead"])
    assert [(kind.name, kind.variants) for kind in found.kinds] == [("cut-in, straight", 2), ("leader", 1)]


SCENES_SPEC = CampaignSpec(families=("low",), methods=("random",), seeds=(3,))
F, S, R = Outcome.FAILURE, Outcome.SAFE, Outcome.REJECTED
GAPS = ((F, 12.0), (F, 14.0), (S, 13.0), (S, 30.0), (S, 40.0), (R, 11.0))


@pytest.fixture
def found(ledger):
    """Returns low's effects for episodes with these outcomes and leader gaps."""

    def effects(gaps):
        campaign = ledger.create(SCENES_SPEC)
        episodes = [
            StoredRecord(i, campaign.runs[0].number, episode_record(i, each, scene=LOW_SCENE | {"lead_gap_m": gap}))
            for i, (each, gap) in enumerate(gaps)
        ]
        families = scene_effects(campaign, episodes).families
        return families[0] if families else None

    return effects


def by_name(family):
    return {parameter.name: parameter for parameter in family.parameters}


def test_an_effect_is_how_often_a_failing_scene_has_the_larger_value(found):
    gap = by_name(found(GAPS))["lead_gap_m"]
    assert gap.effect == pytest.approx(1 / 6)  # 14 > 13, of 2 x 3 pairs
    wanted = mannwhitneyu([12, 14], [13, 30, 40], method="asymptotic").pvalue
    assert gap.p == pytest.approx(min(1.0, 9 * wanted))  # of nine parameters


def test_failing_and_safe_scenes_exchanged_mirror_the_effect(found):
    exchanged = [({F: S, S: F}.get(each, each), gap) for each, gap in GAPS]
    assert by_name(found(exchanged))["lead_gap_m"].effect == pytest.approx(5 / 6)


def test_each_two_parameters_have_their_cells_once(found):
    family = found(GAPS)
    pairs = {frozenset(pair.parameters): pair for pair in family.pairs}
    assert pairs.keys() == {frozenset(pair) for pair in itertools.combinations(by_name(family), 2)}
    pair = pairs[frozenset(("lead_gap_m", "friction"))]
    for counts, of in ((pair.played, "played"), (pair.failed, "failed")):
        for axis, name in enumerate(pair.parameters):
            sums = [sum(row) for row in (counts if axis == 0 else zip(*counts, strict=True))]
            assert sums == getattr(by_name(family)[name], of)


def test_rates_are_those_of_the_methods_that_learn_where_there_are_any(ledger, metrics):
    campaign = ledger.create(CampaignSpec(families=("low",), methods=("sac", "random")))
    learning = changed(RUN, metrics=metrics.model_copy(update={"window_ecr": 0.4, "dual_variable": 0.5}))
    control = changed(
        RUN, method="random", metrics=metrics.model_copy(update={"window_ecr": 0.0, "dual_variable": 0.0})
    )
    for state in (State.RUNNING, State.SUCCEEDED):
        runs = (changed(learning, state=state), control)
        shown = progress(changed(campaign, state=State.RUNNING, runs=runs), workers=1)
        assert (shown.window_ecr, shown.dual_variable) == (0.4, 0.5)
    alone = progress(changed(campaign, state=State.RUNNING, runs=(control,)), workers=1)
    assert (alone.window_ecr, alone.dual_variable) == (0.0, 0.0)
