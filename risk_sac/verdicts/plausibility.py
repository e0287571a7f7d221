"""Judges how likely road users behave as a recording's adversaries do.

Two probabilities decide, and the less likely counts. The first is the least of all features', corrected for their
number (Holm 1979): traffic of many honest actors stays ordinary. The second is of all of them together, by the
truncated product (Zaykin et al. 2002) and the product of the two least likely events: an adversary that stays just
inside every threshold does not stay ordinary.

Choice: events are independent, such as three stops of one driver; features of one event count once, by the least
likely. A feature without a published distribution makes a failure rare at most.
"""

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from itertools import groupby
from pathlib import Path
from typing import NamedTuple

from risk_sac.records import BehaviourFact, Plausibility, PlausibilityClass
from risk_sac.risk.driving import FEATURES, LEAST, HasTails, LowerTail, UpperTail, tail_probability
from risk_sac.verdicts.behaviour import Observed, observed_of
from risk_sac.verdicts.evidence import Evidence

ORDINARY, RARE = 1e-2, 1e-4
TRUNCATIONS = (0.05, 1.0)  # choice: a few unlikely events among many, and many slightly unlikely ones
# Choice: drivers overlook the vehicle beside them in 1 of 10,000 lane changes. The published gaps are of drivers that
# looked, and samples of some hundred lane changes say nothing of the others.
OVERLOOKED = 1e-4
NEGLIGIBLE = 1e-12
ROOM = frozenset({"lane_change_gap", "lane_change_headway"})
UNDISTURBED = Path(__file__).with_name("undisturbed.json")


class Undisturbed(NamedTuple):
    """Distributions of SUMO's drivers in undisturbed scenes."""

    spreads: Mapping[str, HasTails]  # of the features without a published distribution
    scale: float  # at least 1: by how much the joint surprise exceeds that of independent features


class JudgedFeature(NamedTuple):
    """A feature with its probability."""

    observed: Observed
    probability: float
    published: bool


def plausibility_of(evidence: Evidence) -> Plausibility:
    """Judges what the adversaries did from the release to the last frame.

    Where nothing deviates from the scenario it is ordinary: its author answers for what it says.
    """
    observed = () if evidence.as_written else observed_of(evidence)
    return judge_observed(observed, evidence.ids, undisturbed())


def judge_observed(observed: Iterable[Observed], ids: Sequence[str], traffic: Undisturbed) -> Plausibility:
    """Judges adversaries' features by published distributions, else by the traffic's."""
    judged = [_probability(each, traffic) for each in observed]
    published = [each for each in judged if each.published]
    least, joint = _least(judged), _joint(judged, traffic.scale)
    surely = min(_least(published), _joint(published, traffic.scale))
    facts = _facts(judged, ids)
    return Plausibility(
        verdict=_class(max(min(least, joint), RARE) if surely >= RARE else surely),
        least_probability=least,
        joint_probability=joint,
        facts=facts,
        sentence=in_words(facts[0]) if facts else "",
    )


def in_words(fact: BehaviourFact) -> str:
    """Formats a fact with its share: "… 1 of 3,000 lane changes"."""
    feature = FEATURES[fact.feature]
    one_in = 1.0 / fact.probability
    digits = 1 - math.floor(math.log10(one_in)) if one_in > 10.0 else 0
    at_most = "at most " if fact.probability <= (OVERLOOKED if fact.feature in ROOM else LEAST) else ""
    by = "" if fact.published else " of SUMO's drivers" if feature.spread is None else " (assumed)"
    share = f"{at_most}1 of {round(one_in, digits):,.0f} {feature.per}{by}"
    return f"{fact.actor} {feature.words.format(value=fact.value)}: {share}"


@cache
def undisturbed() -> Undisturbed:
    """Reads what SUMO's drivers do, as `risk_sac.lab.figures.undisturbed_behaviour` has measured it."""
    shipped = json.loads(UNDISTURBED.read_bytes())
    spreads: dict[str, HasTails] = {}
    for name, (values, probabilities) in shipped["tails"].items():
        tail = UpperTail(tuple(values), tuple(probabilities))
        spreads[name] = tail if FEATURES[name].unlikely == "above" else LowerTail(tail)
    return Undisturbed(spreads, shipped["scale"])


def _probability(observed: Observed, traffic: Undisturbed) -> JudgedFeature:
    feature = FEATURES[observed.feature]
    spread = feature.spread or traffic.spreads[observed.feature]
    least = OVERLOOKED if observed.feature in ROOM else LEAST
    return JudgedFeature(observed, max(tail_probability(feature, spread, observed.value), least), feature.published)


def _least(judged: Sequence[JudgedFeature]) -> float:
    """Returns the least probability, corrected for the number of features (Holm's procedure)."""
    if not judged:
        return 1.0
    return min(1.0, len(judged) * min(each.probability for each in judged))


def _joint(judged: Sequence[JudgedFeature], scale: float) -> float:
    """Returns the probability of independent events at least as unlikely together."""
    events = by_event(judged)
    tests = [*(truncated_product(events, at, scale) for at in TRUNCATIONS), two_least(events, scale)]
    return min(1.0, len(tests) * min(tests))  # Bonferroni's correction for the number of tests


def by_event(judged: Iterable[JudgedFeature]) -> list[float]:
    """Lists each event's probability: its features' least, corrected for their number."""
    grouped = groupby(judged, key=_event)
    features = [[each.probability for each in group] for _, group in grouped]
    return [min(1.0, len(probabilities) * min(probabilities)) for probabilities in features]


def _event(judged: JudgedFeature) -> tuple[int, str, float]:
    observed = judged.observed
    name = FEATURES[observed.feature].event
    return observed.actor, name or observed.feature, observed.time_s


def truncated_product(probabilities: Sequence[float], at: float, scale: float = 1.0) -> float:
    """Returns the probability of a truncated product at most this one.

    P = Σ_k C(n, k) (1 - τ)^(n - k) τ^k · P(Γ(k) ≥ s - k ln(1 / τ)), s = -Σ ln p over p ≤ τ

    Args:
      probabilities: of `n` independent events, above 0.
      at: τ in (0, 1]; 1 is Fisher's method.
      scale: that s is divided by first.

    Returns:
      In [0, 1]; 1 if none is up to τ.
    Source: Zaykin, Zhivotovsky, Westfall and Weir 2002, Genetic Epidemiology 22.
    """
    n, surprise = len(probabilities), -sum(math.log(p) for p in probabilities if p <= at) / scale
    if surprise <= 0.0:
        return 1.0
    fewest = n if at >= 1.0 else 1
    total, log_at = 0.0, math.log(at)
    for k in range(fewest, n + 1):
        share = math.comb(n, k) * (1.0 - at) ** (n - k) * at**k
        total += share * _erlang_above(k, surprise + k * log_at)
        if share < NEGLIGIBLE and k > at * n:  # as are the shares of more
            break
    return min(1.0, total)


def two_least(probabilities: Sequence[float], scale: float = 1.0) -> float:
    """Bounds the probability that the two least have at most this product.

    P ≤ C(n, 2) · w (1 - ln w), w the product: each pair of events has it by itself.

    Args:
      probabilities: of `n` independent events, above 0.
      scale: that -ln w is divided by first.

    Returns:
      In [0, 1]; 1 if there are fewer than two.
    Source: the rank truncated product of Dudbridge and Koeleman 2003, Genetic Epidemiology 25, for two.
    """
    if len(probabilities) < 2:
        return 1.0
    first, second = sorted(probabilities)[:2]
    surprise = -math.log(first * second) / scale
    return min(1.0, math.comb(len(probabilities), 2) * math.exp(-surprise) * (1.0 + surprise))


def _erlang_above(k: int, value: float) -> float:
    """Returns P(sum of `k` exponential numbers of mean 1 > `value`)."""
    if value <= 0.0:
        return 1.0
    term = total = math.exp(-value)
    for i in range(1, k):
        term *= value / i
        total += term
    return total


def _class(probability: float) -> PlausibilityClass:
    if probability >= ORDINARY:
        return PlausibilityClass.ORDINARY
    return PlausibilityClass.RARE if probability >= RARE else PlausibilityClass.IMPLAUSIBLE


def _facts(judged: Sequence[JudgedFeature], ids: Sequence[str]) -> tuple[BehaviourFact, ...]:
    """Lists the least likely value per actor and feature, least likely first."""

    def same(each: JudgedFeature) -> tuple[int, str]:
        return each.observed.actor, each.observed.feature

    facts = []
    for (actor, name), group in groupby(sorted(judged, key=same), key=same):
        alike = list(group)
        worst = min(alike, key=lambda each: each.probability)
        facts.append(
            BehaviourFact(
                actor=ids[actor],
                feature=name,
                value=round(worst.observed.value, 3),
                time_s=round(worst.observed.time_s, 3),
                times=len(alike),
                probability=worst.probability,
                published=worst.published,
            )
        )
    return tuple(sorted(facts, key=lambda fact: fact.probability))
