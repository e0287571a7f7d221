"""Which scene parameters set failing episodes apart, and which cells of the ODD were played."""

import itertools

import pytest
from scipy.stats import mannwhitneyu

from risk_sac.config import CampaignSpec
from risk_sac.records import Outcome, wire
from service.store.stored import PlainEpisode
from service.views.scenes import BINS, scene_effects
from tests.builders import LOW_SCENE

SPEC = CampaignSpec(families=("low",), methods=("random",), seeds=(3,))
F, S, R = Outcome.FAILURE, Outcome.SAFE, Outcome.REJECTED
GAPS = ((F, 12.0), (F, 14.0), (S, 13.0), (S, 30.0), (S, 40.0), (R, 11.0))


@pytest.fixture
def found(ledger):
    """Makes the answer about low of episodes with these outcomes and gaps to the leader."""

    def effects(gaps, **others):
        campaign = ledger.create(SPEC)
        episodes = [
            PlainEpisode(
                i, campaign.runs[0].number, "search", i, each, {"scene": LOW_SCENE | {"lead_gap_m": gap} | others}
            )
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


def test_the_largest_effect_stands_first_and_what_does_not_vary_has_none(found):
    first, *others = found(GAPS).parameters
    assert first.name == "lead_gap_m"
    assert {(each.effect, each.p) for each in others} == {(0.5, 1.0)}


def test_without_a_failure_no_effect_is_known(found):
    family = found([(S, 20.0), (S, 30.0)])
    assert family.failures == 0
    assert '"effect":null' in wire(family).decode()


def test_what_was_refused_was_not_played(found):
    family = found(GAPS)
    assert (family.episodes, family.failures) == (5, 2)
    assert found([(R, 12.0)]) is None
    for parameter in family.parameters:
        assert (sum(parameter.played), sum(parameter.failed)) == (5, 2)
        assert len(parameter.bins) == BINS


def test_each_two_parameters_have_their_cells_once(found):
    family = found(GAPS)
    pairs = {frozenset(pair.parameters): pair for pair in family.pairs}
    assert pairs.keys() == {frozenset(pair) for pair in itertools.combinations(by_name(family), 2)}
    pair = pairs[frozenset(("lead_gap_m", "friction"))]
    for counts, of in ((pair.played, "played"), (pair.failed, "failed")):
        for axis, name in enumerate(pair.parameters):
            sums = [sum(row) for row in (counts if axis == 0 else zip(*counts, strict=True))]
            assert sums == getattr(by_name(family)[name], of)


def test_the_odd_bounds_the_bins(ledger):
    spec = CampaignSpec.model_validate(
        {"families": ["low"], "methods": ["random"], "odd": {"environment": {"friction": {"low": 0.7, "high": 0.9}}}}
    )
    campaign = ledger.create(spec)
    episode = PlainEpisode(1, campaign.runs[0].number, "search", 0, F, {"scene": LOW_SCENE})
    friction = by_name(scene_effects(campaign, [episode]).families[0])["friction"]
    assert (friction.bins[0][:3], friction.bins[-1][-3:]) == ("0.7", "0.9")
