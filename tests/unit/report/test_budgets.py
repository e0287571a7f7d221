"""What a search had found when a budget was spent, counted by hand."""

from collections.abc import Callable
from dataclasses import replace

import pytest

from risk_sac.config import CampaignSpec
from risk_sac.report import FinishedRun, compare
from risk_sac.report.runs import Limit, cpu_s, episodes, found_within


@pytest.fixture
def run(spec: CampaignSpec, finished: Callable[..., FinishedRun]) -> FinishedRun:
    """F: a failure that no driver prevents, f: one that the careful driver prevents, r: a refused scene."""
    return replace(finished(spec.runs()[0], ".FrfFf", "f"), episode_cpu_s=(2.0, 4.0, 4.5, 9.0, 10.0, 12.0, 20.0))


def test_each_kind_counts_once_from_the_episode_on_that_found_it(run: FinishedRun) -> None:
    counts = [(found.preventable, found.distinct) for found in run.found]
    assert counts == [(0, 0), (0, 1), (0, 1), (1, 2), (1, 2), (1, 2)]


@pytest.mark.parametrize(
    ("limit", "expected"),
    [
        (Limit("", cpu_s, 1.0), (0, 0)),  # the first episode ended later
        (Limit("", cpu_s, 8.9), (0, 1)),
        (Limit("", cpu_s, 9.0), (1, 2)),
        (Limit("", episodes, 2), (0, 1)),
        (Limit("", episodes, 6), (1, 2)),
    ],
)
def test_what_ended_within_the_limit_counts(run: FinishedRun, limit: Limit, expected: tuple[int, int]) -> None:
    found = found_within(run, limit)
    assert found is not None
    assert (found.preventable, found.distinct) == expected


def test_our_own_search_is_tested_against_the_others_on_what_a_user_pays_for(
    spec: CampaignSpec, finished: Callable[..., FinishedRun]
) -> None:
    budget = {"budget": spec.budget.model_copy(update={"evaluation_episodes": 0})}
    methods = {"methods": ("risk-sac", "risk-sac-diverse", "random"), "seeds": tuple(range(6))}
    wanted = spec.model_copy(update=budget | methods)
    letters = {"risk-sac": "....", "risk-sac-diverse": "f...", "random": "f..."}
    runs = [replace(finished(run, letters[run.method]), episode_cpu_s=(5.0, 10.0, 20.0, 31.0)) for run in wanted.runs()]
    against = {test.method: test for test in compare(wanted, runs, "a command").paid_tests}
    assert {test.reference for test in against.values()} == {"risk-sac-diverse"}
    assert (against["risk-sac"].difference, against["random"].difference) == (1.0, 0.0)
    assert against["risk-sac"].p == pytest.approx(2 / 2**6)
    assert against["risk-sac"].p_holm == pytest.approx(2 * 2 / 2**6)  # of two hypotheses, whatever else is tested
