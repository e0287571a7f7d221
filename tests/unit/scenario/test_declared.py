"""Declared distributions of scenes, by scipy's estimators, and shares of scenes."""

import re

import numpy as np
import pytest
import yaml
from scipy import stats

from risk_sac.config.distribution import RankCorrelation
from risk_sac.config.scenario import ScenarioParameter
from risk_sac.errors import ConfigError
from risk_sac.scenario.declared import SceneLaw
from risk_sac.scenario.reading import document_from
from risk_sac.scenario.space import Parameter, SceneSpace

PARAMETERS = {
    "gap": ScenarioParameter(range=(0, 10), distribution={"kind": "normal", "mean": 3, "deviation": 2}),
    "count": ScenarioParameter(range=(0, 20), distribution={"kind": "poisson", "expected": 4}),
    "body": ScenarioParameter(words=("car", "van", "truck"), distribution={"kind": "weights", "weights": (1, 0, 3)}),
    "speed": ScenarioParameter(range=(-5, 5)),
    "fixed": ScenarioParameter(range=(3, 3)),
}
CORRELATED = RankCorrelation(
    parameters=("count", "speed", "gap"), spearman=((1, 0.5, 0.2), (0.5, 1, -0.6), (0.2, -0.6, 1))
)


def space_of(**bounds):
    told = {name: bounds.get(name, one.range or (0.0, 1.0)) for name, one in PARAMETERS.items()}
    return SceneSpace("any", tuple(Parameter(name, "", *told[name], "") for name in PARAMETERS))


@pytest.fixture(scope="module")
def samples():
    declared = SceneLaw.of(space_of(), PARAMETERS, CORRELATED)
    normal = np.random.default_rng(0).standard_normal((4000, len(PARAMETERS)))
    return declared, normal, np.array([declared.point(one) for one in normal])


def test_samples_have_the_declared_rank_correlation(samples):
    ranks = stats.spearmanr(samples[2][:, [1, 3, 0]])[0]
    assert np.abs(ranks - np.array(CORRELATED.spearman)).max() < 0.05  # counts have ties


def test_samples_have_the_declared_margins(samples):
    gaps = samples[2][:, 0] * 10
    assert stats.kstest(gaps, stats.truncnorm(-1.5, 3.5, loc=3, scale=2).cdf).pvalue > 0.01
    assert stats.kstest(samples[2][:, 3], "uniform").pvalue > 0.01
    assert np.bincount((samples[2][:, 2] * 3).astype(int), minlength=3) / 4000 == pytest.approx(
        [0.25, 0, 0.75], abs=0.03
    )
    assert set(samples[2][:, 4]) == {0.0}


def test_a_scene_tells_the_normal_numbers_that_it_was_drawn_from(samples):
    declared, normal, points = samples
    assert declared.telling.tolist() == [True, False, True, True, False]  # a count does not tell its share
    told = np.array([declared.normal(point) for point in points[:200]])
    assert told[:, declared.telling] == pytest.approx(normal[:200, declared.telling], abs=1e-6)


def test_without_distributions_shares_are_points():
    declared = SceneLaw.of(space_of(), {"speed": PARAMETERS["speed"]}, None)
    shares = np.array([0.1, 0.2, 0.3, 0.4, 0.5])
    assert declared.alike
    assert declared.unit(shares) is shares


def test_the_distribution_is_truncated_to_what_the_odd_leaves():
    declared = SceneLaw.of(space_of(gap=(4, 5)), PARAMETERS, None)
    drawn = np.array([declared.unit(shares)[0] for shares in np.random.default_rng(1).random((2000, 5))])
    assert stats.kstest(4 + drawn, stats.truncnorm(0.5, 1.0, loc=3, scale=2).cdf).pvalue > 0.01


def test_an_odd_without_mass_is_refused():
    narrow = {"gap": ScenarioParameter(range=(0, 100), distribution={"kind": "normal", "mean": 3, "deviation": 1})}
    with pytest.raises(ConfigError) as caught:
        SceneLaw.of(space_of(gap=(60, 100)), narrow, None)
    assert caught.value.field == "parameters.gap.distribution"


def test_density_is_that_of_the_samples(samples):
    declared, points = samples[0], samples[2]
    inside = (points[:, [0, 3]] > 0.3).all(axis=1) & (points[:, [0, 3]] < 0.5).all(axis=1)
    steps = np.linspace(0.31, 0.49, 10)
    grid = np.array([[gap, 0.2, 0.9, speed, 0.0] for gap in steps for speed in steps])
    pair = SceneLaw(declared.axes, RankCorrelation(parameters=("speed", "gap"), spearman=((1, -0.6), (-0.6, 1))))
    density = np.mean([pair.density(one) for one in grid]) / pair.axes[2].density(0.9)
    assert inside.mean() == pytest.approx(density * 0.04, rel=0.15)


@pytest.mark.parametrize(
    ("law", "wanted"),
    [
        ({"kind": "norml"}, r"'uniform', 'normal', .*; did you mean normal\?$"),
        ({"kind": "\0" + "x" * 5000}, r"'uniform', 'normal', "),
        ({"mean": 1}, r"wanted a 'kind'"),
    ],
)
def test_an_unknown_kind_of_distribution_is_refused_in_one_line_with_those_that_exist(law, wanted):
    text = yaml.safe_dump({"parameters": {"gap": {"range": [0, 10], "distribution": law}}})
    with pytest.raises(ConfigError) as refusal:
        document_from(text)
    line = next(line for line in map(str, (refusal.value, *refusal.value.others)) if "distribution" in line)
    assert re.search(wanted, line)
    assert line.isprintable()
    assert len(line) < 500
