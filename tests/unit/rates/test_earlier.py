"""Estimates that start from failures of earlier runs."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import ncx2

from risk_sac import cli
from risk_sac.config import CampaignSpec, RateStart, RunSpec
from risk_sac.env.problem import Problem
from risk_sac.errors import ConfigError
from risk_sac.rates.proposal import DECLARED, Stages, around, defensive, draws_of, log_normal
from risk_sac.rates.record import MOST, estimated, start_in
from risk_sac.run_folder.results import EPISODES, RecordedFailure, read_results, records_from_lines, write_results
from risk_sac.verdicts.judge import DEFINITIONS
from tests.earlier_runs import FAILURES, run_folder

# A ball far out in three dimensions: nothing near it tells that it is there, as an occluded child does not.
CENTRE, RADIUS, DRAWS = np.array([2.4, -1.2, 1.8]), 0.8, 1000
RATE = float(ncx2.cdf(RADIUS**2, 3, (CENTRE**2).sum()))  # P(|z - c|² ≤ r²) of normal z; 1.1e-3


def fails(point):
    return float(((point - CENTRE) ** 2).sum()) <= RADIUS**2


def estimate(seed, earlier=None):
    stages, points = Stages(3, DRAWS, seed, earlier), []

    def known():
        return draws_of(points, [{"m": 0.0 if fails(each) else 1.0} for each in points], [fails(z) for z in points])

    for number in range(DRAWS):
        points.append(stages.draw(number, known))
    draws = known()
    return estimated(stages.ratios(draws), stages.trust(DRAWS), draws.failed, np.ones(DRAWS, dtype=bool))


def earlier_failures(seed):
    """Twelve failures, as a search spreads them: evenly over the ball."""
    found, random = [], np.random.default_rng(seed)
    while len(found) < 12:
        point = CENTRE + random.uniform(-RADIUS, RADIUS, 3)
        found += [point] if fails(point) else []
    return np.array(found)


def test_earlier_failures_make_an_estimate_of_what_draws_alone_do_not_find():
    alone = [estimate(seed) for seed in range(6)]
    started = [estimate(seed, earlier_failures(seed)) for seed in range(6)]
    assert sum(each.rate is not None for each in alone) <= 1
    assert all(each.rate is not None for each in started)
    assert sum(each.low <= RATE <= each.high for each in started) >= 5
    assert np.mean([each.rate for each in started]) == pytest.approx(RATE, rel=0.15)


def test_wrong_earlier_failures_cost_draws_and_bias_nothing():
    wrong = np.random.default_rng(3).normal(-CENTRE, 0.3, (12, 3))
    known = [each for each in (estimate(seed, wrong) for seed in range(6)) if each.rate is not None]
    assert all(each.low / 3 <= RATE <= each.high * 3 for each in known)


def test_no_weight_exceeds_what_the_declared_share_allows_whatever_failed_before():
    points = np.random.default_rng(0).normal(size=(500, 3)) * 3
    first = defensive(3, around(np.full((1, 3), 5.0), np.random.default_rng(0)))
    assert np.exp(log_normal(points) - first.log_density(points)).max() <= 1 / DECLARED + 1e-9


def test_a_few_failures_have_a_gaussian_each_by_hand():
    mixture = around(np.array([[2.0, 0.0], [0.0, -1.0]]), np.random.default_rng(0))
    at_first = (1.0 + math.exp(-0.5 * (4 + 1))) / 2 / (2 * math.pi)
    assert mixture is not None
    assert math.exp(mixture.log_density(np.array([[2.0, 0.0]]))[0]) == pytest.approx(at_first)
    assert around(np.empty((0, 2)), np.random.default_rng(0)) is None


def earlier_run(folder, family="low", failures=FAILURES, definitions=DEFINITIONS):
    """A run's folder whose first episodes failed, judged by these definitions."""
    records = records_from_lines((run_folder(folder, family) / EPISODES).read_bytes())[:failures]
    found = tuple(RecordedFailure.of("earlier", record) for record in records)
    versions = {"definitions": str(definitions)}
    write_results(folder, replace(read_results(folder), failures=found, versions=versions))


def test_the_scenes_of_valid_failures_are_read_from_a_run_or_a_campaign(tmp_path):
    earlier_run(tmp_path / "whole" / "runs" / "low-archive-1")
    earlier_run(tmp_path / "whole" / "runs" / "mixed-archive-1", "mixed")
    start = start_in(tmp_path / "whole", "low")
    assert len(start.scenes) == FAILURES <= MOST
    assert start == start_in(tmp_path / "whole" / "runs" / "low-archive-1", "low")
    problem = Problem.from_spec(RunSpec(family="low", method="rate", seed=0, rate=start))
    assert problem.declared.normals(start.scenes).shape == (FAILURES, int(problem.declared.telling.sum()))


@pytest.mark.parametrize("given", ["missing", "of-mixed", "unfailed", "outdated"])
def test_what_no_estimate_can_start_from_is_refused_in_one_line(tmp_path, capsys, given):
    earlier_run(tmp_path / "of-mixed", "mixed")
    earlier_run(tmp_path / "unfailed", failures=0)
    earlier_run(tmp_path / "outdated", definitions=3)
    assert cli.main(["rate", "low", "--from", str(tmp_path / given), "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err.strip()
    assert said.count("\n") == 0
    assert said.startswith("--from: got ")
    assert not (tmp_path / "out").exists()


def test_a_start_belongs_to_the_method_and_to_one_scenario():
    start = RateStart(scenes=({"friction": 0.8},))
    with pytest.raises(ValueError, match="without the method rate"):
        CampaignSpec(families=("low",), methods=("random",), rate=start)
    with pytest.raises(ValueError, match="2 families"):
        CampaignSpec(families=("low", "mixed"), methods=("rate",), rate=start)
    searched, rated = CampaignSpec(families=("low",), methods=("random", "rate"), rate=start).searches()
    assert (searched.rate, rated.rate) == (None, start)
    with pytest.raises(ConfigError, match=r"rate\.scenes"):
        Problem.from_spec(rated)  # which lacks all other parameters


def test_a_spec_without_a_start_is_written_as_before():
    assert "rate" not in RunSpec(family="low", method="rate", seed=0).model_dump()
