"""Which scene parameters set failing episodes apart, and which cells of the ODD were played."""

import itertools

import pytest
from scipy.stats import mannwhitneyu

from risk_sac.config import CampaignSpec
from risk_sac.records import Outcome
from service.store.stored import PlainEpisode
from service.views.scenes import scene_effects
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


def test_each_two_parameters_have_their_cells_once(found):
    family = found(GAPS)
    pairs = {frozenset(pair.parameters): pair for pair in family.pairs}
    assert pairs.keys() == {frozenset(pair) for pair in itertools.combinations(by_name(family), 2)}
    pair = pairs[frozenset(("lead_gap_m", "friction"))]
    for counts, of in ((pair.played, "played"), (pair.failed, "failed")):
        for axis, name in enumerate(pair.parameters):
            sums = [sum(row) for row in (counts if axis == 0 else zip(*counts, strict=True))]
            assert sums == getattr(by_name(family)[name], of)
