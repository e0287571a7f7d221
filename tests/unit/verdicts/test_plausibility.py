import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import combine_pvalues

from risk_sac.records import PlausibilityClass
from risk_sac.risk.driving import FEATURES
from risk_sac.scenario.bodies import CODES
from risk_sac.scenario.layout import Area
from risk_sac.verdicts.behaviour import Observed, observed_of, pedal_changes, runs, smoothed
from risk_sac.verdicts.plausibility import (
    judge_observed,
    plausibility_of,
    truncated_product,
    two_least,
    undisturbed,
)
from tests.unit.verdicts.staged import (
    STREET,
    cut_in,
    leader_brakes,
    mirrored,
    pedestrian_crosses,
    sideways,
    stage,
    straight,
)


def values(evidence, name: str) -> list[float]:
    both = [[each.value for each in observed_of(e) if each.feature == name] for e in (evidence, mirrored(evidence))]
    assert both[0] == pytest.approx(both[1])
    return both[0]


def verdict(*observed: Observed) -> PlausibilityClass:
    return judge_observed(observed, ["ego", "left", "right", "lead"], undisturbed()).verdict


class TestObserved:
    def test_a_stop_is_one_braking_with_its_hardest_half_second(self):
        assert values(leader_brakes(braking=6.0), "braking") == pytest.approx([6.0])

    def test_pedals_that_change_are_counted(self):
        pulses = [(1.0, -4.0), (2.0, 3.0), (3.0, -4.0), (4.0, 3.0), (5.0, -9.0)]
        leader = stage(straight(0.0, 0.0, 0.0, 14.0), straight(30.0, 0.0, 0.0, 14.0, *pulses))
        assert values(leader, "pedal_changes") == [4.0]

    def test_a_pedal_that_is_touched_counts_and_a_breath_of_one_does_not(self):
        for touch, changes in ((0.7, 3.0), (0.4, 0.0)):
            pulses = [(1.0, -touch), (2.0, touch), (3.0, -touch), (4.0, touch), (5.0, 0.0)]
            driven = stage(straight(0.0, 0.0, 0.0, 14.0), straight(60.0, 0.0, 0.0, 14.0, *pulses), contact=False)
            assert values(driven, "pedal_changes") == [changes]

    def test_a_lane_change_leaves_a_gap(self):
        (gap,) = values(cut_in(gap=12.0, ego=14.0, other=9.0), "lane_change_gap")
        assert 3.0 < gap < 12.0  # the ego closes in by 5 m/s while the other comes over

    def test_a_lane_change_beside_the_ego_leaves_none(self):
        beside = sideways(straight(-1.5 * 12.0, 3.3, 0.0, 12.0), 2.0, -1.2, 3.3)
        evidence = stage(straight(-1.5 * 12.0, 0.0, 0.0, 12.0), beside)
        assert values(evidence, "lane_change_gap") == [0.0]
        assert plausibility_of(evidence).verdict is PlausibilityClass.RARE  # as of a driver that overlooks the ego

    @pytest.mark.parametrize(("moved_m", "keeps_s"), [(1.0, 6.0), (0.65, 6.3), (0.4, 0.0)])
    def test_keeping_over_the_line_or_beside_it_is_timed_without_the_way_there(self, moved_m, keeps_s):
        hovers = sideways(straight(20.0, 3.3, 0.0, 12.0), 1.0, -1.0, moved_m)
        evidence = stage(straight(0.0, 0.0, 0.0, 12.0), hovers, contact=False, until_s=8.0)
        assert values(evidence, "over_line") == pytest.approx([keeps_s], abs=0.21)

    def test_changing_lanes_is_no_keeping_to_the_line(self):
        assert values(cut_in(gap=12.0, ego=14.0, other=9.0), "over_line") == pytest.approx([0.0])

    def test_crawling_through_a_junction_is_timed_and_stopping_there_apart(self):
        crawls = straight(60.0, -12.0, math.pi / 2, 2.0, (6.5, -2.0))
        junction = replace(STREET, junctions=(Area.box(50.0, 70.0, -10.0, 10.0),))
        evidence = stage(straight(0.0, 0.0, 0.0, 1.0), crawls, ground=junction, contact=False, until_s=9.5)
        entered_s = (12.0 - 10.0 - 4.6 / 2) / 2.0 - 1.5
        assert values(evidence, "junction_crawl") == pytest.approx([7.5 - max(entered_s, 0.0)], abs=0.3)
        assert values(evidence, "junction_stop") == pytest.approx([2.0], abs=0.3)
        assert plausibility_of(evidence).facts[0].feature == "junction_crawl"
        assert plausibility_of(evidence).verdict is PlausibilityClass.RARE

    def test_driving_through_a_junction_is_no_crawling(self):
        junction = replace(STREET, junctions=(Area.box(50.0, 70.0, -10.0, 10.0),))
        drives = straight(60.0, -30.0, math.pi / 2, 6.0)
        evidence = stage(straight(0.0, 0.0, 0.0, 1.0), drives, ground=junction, contact=False, until_s=8.0)
        assert values(evidence, "junction_crawl") == values(evidence, "junction_stop") == [0.0]

    def test_a_pedestrian_s_speed_is_measured(self):
        assert values(pedestrian_crosses(walk=1.9), "walking_speed") == pytest.approx([1.9])

    def test_a_cyclist_that_crosses_is_judged_as_one_that_rides(self):
        walks = pedestrian_crosses(walk=5.0)
        rides = replace(walks, body=np.array([CODES["car"], CODES["bicycle"]], dtype=np.int8))
        assert values(rides, "riding_speed") == pytest.approx([5.0])
        assert values(rides, "walking_speed") == []
        assert plausibility_of(walks).verdict is PlausibilityClass.IMPLAUSIBLE
        assert plausibility_of(rides).verdict is not PlausibilityClass.IMPLAUSIBLE

    def test_an_entry_on_red_is_timed_from_the_start_of_red(self):
        evidence = stage(straight(0.0, 50.0, 0.0, 10.0), straight(0.0, 0.0, 0.0, 10.0), contact=False, until_s=6.0)
        link = evidence.link.copy()
        shown = (evidence.time_s >= 1.0 - 1e-9) & (evidence.time_s < 4.0 - 1e-9)
        link[evidence.time_s < 1.0 - 1e-9, 1], link[shown, 1] = ord("y"), ord("r")
        assert values(replace(evidence, link=link), "red_entry") == pytest.approx([2.9], abs=0.11)

    def test_one_that_stands_does_nothing(self):
        evidence = stage(straight(0.0, 0.0, 0.0, 10.0), straight(60.0, 0.0, 0.0, 0.0))
        assert observed_of(evidence) == []
        assert plausibility_of(evidence).verdict is PlausibilityClass.ORDINARY


class TestClass:
    def test_ordinary_driving_is_ordinary(self):
        assert (
            verdict(Observed(1, "braking", 4.0, 1.0), Observed(1, "speeding", 1.0, 2.0)) is PlausibilityClass.ORDINARY
        )

    def test_one_thing_that_is_rare_makes_it_rare(self):
        assert verdict(Observed(1, "braking", 8.0, 1.0)) is PlausibilityClass.RARE

    def test_the_same_is_ordinary_among_many(self):
        calm = [Observed(k, "speeding", -1.0, 0.0) for k in range(50)]
        hard = Observed(3, "braking", 8.0, 1.0)
        ids = [f"actor {k}" for k in range(50)]
        assert judge_observed([*calm, hard], ids, undisturbed()).verdict is PlausibilityClass.ORDINARY

    def test_many_things_just_inside_the_threshold_are_implausible_together(self):
        stops = [Observed(1, "braking", 5.4, float(k)) for k in range(12)]  # each 1 of 46
        assert verdict(*stops[:1]) is PlausibilityClass.ORDINARY
        assert verdict(*stops) is PlausibilityClass.IMPLAUSIBLE

    @pytest.mark.parametrize("name", [f.name for f in FEATURES.values() if not f.published and f.unlikely == "above"])
    def test_what_has_no_published_distribution_is_rare_at_most(self, name):
        assert verdict(*(Observed(1, name, 1e3, float(k)) for k in range(5))) is PlausibilityClass.RARE

    def test_features_of_one_event_count_once(self):
        change = [Observed(1, name, 1.5, 2.0) for name in ("lane_change_gap", "lane_change_headway")]
        alone = judge_observed(change[:1], ["ego", "left"], undisturbed())
        both = judge_observed(change, ["ego", "left"], undisturbed())
        assert both.joint_probability >= alone.joint_probability

    def test_the_sentence_names_the_least_likely(self):
        judged = judge_observed(
            [Observed(1, "braking", 4.0, 1.0), Observed(2, "lane_change_headway", 0.2, 3.0)],
            ["ego", "left", "right"],
            undisturbed(),
        )
        assert judged.sentence == "right changes lane 0.2 s before the next vehicle: 1 of 260 lane changes"
        assert [fact.feature for fact in judged.facts] == ["lane_change_headway", "braking"]

    def test_all_features_are_kept_each_by_its_least_likely_value(self):
        judged = judge_observed([Observed(1, "braking", v, v) for v in (3.0, 6.0, 5.0)], ["ego", "left"], undisturbed())
        (fact,) = judged.facts
        assert (fact.value, fact.time_s, fact.times) == (6.0, 6.0, 3)

    def test_two_late_entries_on_red_are_implausible_and_one_is_rare(self):
        late = [Observed(k, "red_entry", 5.0, float(k)) for k in (1, 2)]
        calm = [Observed(1, "speeding", 0.0, float(k)) for k in range(8)]
        assert verdict(late[0], *calm) is PlausibilityClass.RARE
        assert verdict(*late, *calm) is PlausibilityClass.IMPLAUSIBLE

    def test_a_late_entry_on_red_by_one_that_plays_with_the_pedals_is_implausible(self):
        calm = [Observed(2, "speeding", 0.0, float(k)) for k in range(8)]
        late = Observed(1, "red_entry", 5.0, 3.0)
        assert verdict(late, Observed(1, "pedal_changes", 3.0, 5.0), *calm) is PlausibilityClass.RARE
        assert verdict(late, Observed(1, "pedal_changes", 6.0, 5.0), *calm) is PlausibilityClass.IMPLAUSIBLE


class TestTruncatedProduct:
    def test_without_truncation_it_is_fisher_s_method(self):
        for probabilities in ([0.3], [0.2, 0.04, 0.9], [0.01, 0.6, 0.5, 0.02, 0.3]):
            wanted = combine_pvalues(probabilities, method="fisher").pvalue
            assert truncated_product(probabilities, 1.0) == pytest.approx(wanted)

    def test_it_has_the_distribution_of_random_numbers(self):
        random = np.random.default_rng(3)
        found = np.array([truncated_product(random.random(12).tolist(), 0.05) for _ in range(4000)])
        for share in (0.01, 0.05, 0.2):
            assert (found <= share).mean() == pytest.approx(share, abs=4 * math.sqrt(share / 4000))

    def test_the_two_least_by_hand(self):
        assert two_least([0.9, 1e-3, 0.5, 1e-2], 1.0) == pytest.approx(6 * 1e-5 * (1.0 + math.log(1e5)))
        assert two_least([1e-9]) == 1.0

    def test_the_two_least_bound_the_share_of_random_numbers(self):
        random = np.random.default_rng(4)
        found = np.array([two_least(random.random(8).tolist()) for _ in range(20000)])
        for share in (0.001, 0.01, 0.1):
            assert share / 4 < (found <= share).mean() <= share + 3 * math.sqrt(share / 20000)

    def test_nothing_unlikely_is_certain(self):
        assert truncated_product([0.5, 0.8], 0.05) == 1.0
        assert truncated_product([], 0.05) == truncated_product([], 1.0) == 1.0


def test_smoothing_runs_and_changes_by_hand():
    assert smoothed(np.array([1.0, 2.0, 3.0, 4.0]), 2).tolist() == [1.5, 2.5, 3.5]
    assert len(smoothed(np.ones(3), 5)) == 0
    assert runs(np.array([True, False, True, True])) == [(0, 1), (2, 4)]
    held = np.array([2.0, 0.0, -2.0, -2.0, 0.0, 2.0])
    assert pedal_changes(held, np.arange(6.0)) == (2.0, 5.0)
    assert pedal_changes(held, np.arange(6.0) * 9.0)[0] == 1.0
