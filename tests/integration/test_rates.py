"""Failure rates of an ego in a scenario whose document declares distributions."""

import json

import numpy as np
import pytest

from risk_sac import cli
from risk_sac.config import Budget, CampaignSpec, DynamicElements, EgoConfig, Iid, Interval, Odd, Requirement, RunSpec
from risk_sac.env.problem import Problem, checked_campaign
from risk_sac.errors import ConfigError
from risk_sac.rates.record import rates_of, write_rates
from risk_sac.records import EpisodeRecord, Outcome, stored
from risk_sac.records.rates import ANY
from risk_sac.report.trend import EndedCampaign, EndedRun, trend
from risk_sac.run_folder.results import read_rates
from risk_sac.scenario.library import VARIABLE, keep
from risk_sac.scenario.reading import document_from
from risk_sac.search.loop import execute_run
from risk_sac.search.run import RunState
from tests.listener import Listener
from tests.versions import SOFTWARE

SOURCE = "choice of this test"
CLOSING = f"""
name: closing
network: motorway
horizon_s: 5
parameters:
  ego_speed_mps: {{unit: m/s, range: [20, 30], odd: dynamic.ego_speed_mps}}
  gap_m:
    unit: m
    range: [20, 60]
    distribution: {{kind: normal, mean: 50, deviation: 10}}
    source: {SOURCE}
  slower_mps: {{unit: m/s, range: [2, 14], distribution: {{kind: lognormal, log_mean: 1.5, log_deviation: 0.4}}}}
rank_correlation: {{parameters: [gap_m, slower_mps], spearman: [[1, -0.5], [-0.5, 1]]}}
ego: {{start: {{lane: main_1, at_m: 300}}, speed: ego_speed_mps}}
actors:
  lead: {{start: {{ahead_of: ego, gap_m: gap_m}}, speed: ego_speed_mps - slower_mps}}
constraints: [gap_m - 2 * slower_mps > 0]
"""
DRAWS = 24
BLIND = EgoConfig(driver="idm-aeb", defects=("late-braking",))


@pytest.fixture(scope="module")
def family(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(VARIABLE, str(tmp_path_factory.mktemp("places")))
        yield keep(document_from(CLOSING), {})


@pytest.fixture(scope="module")
def spec(family):
    near = Requirement(name="keeps_away", formula="vehicle_gap_m >= 31", scale=10)
    budget = Budget(episodes=DRAWS)
    return RunSpec(family=family, method="rate", seed=1, budget=budget, ego=BLIND, requirements=(near,))


@pytest.fixture(scope="module")
def whole(spec, tmp_path_factory):
    listener = Listener()
    return execute_run(spec, tmp_path_factory.mktemp("whole"), listener), listener.records


def test_an_interrupted_estimate_goes_on_as_if_it_never_was(spec, whole, tmp_path):
    execute_run(spec, tmp_path, Listener(7))  # in the middle of a stage
    resumed, after = execute_run(spec, tmp_path, again := Listener()), again.records
    assert resumed.finished
    assert list(map(stored, after)) == list(map(stored, whole[1]))
    assert resumed.digest == whole[0].digest
    assert rates_of(spec, after, 3.0) == rates_of(spec, whole[1], 3.0)


def test_an_estimate_follows_from_the_stored_records_alone(spec, whole):
    read = [EpisodeRecord.model_validate_json(stored(record)) for record in whole[1]]
    told = rates_of(spec, read, 2.0)
    assert told == rates_of(spec, whole[1], 2.0)
    assert set(told.rates) == {ANY, "no_contact", "on_carriageway", "keeps_away"}
    assert told.rates[ANY].failures == sum(record.outcome is Outcome.FAILURE for record in read) > 0
    assert told.draws == told.asked == DRAWS
    assert told.played == sum(record.outcome is not Outcome.REJECTED for record in read) < DRAWS  # by the constraint
    assert told.distributions["gap_m"].model_dump() == {"kind": "normal", "source": SOURCE}
    assert told.distributions["ego_speed_mps"].kind == "uniform"
    assert told.correlated == ("gap_m", "slower_mps")


def test_nothing_attacks_in_an_estimate(whole):
    assert {record.driven_by for record in whole[1]} == {None}


def test_independent_scenes_follow_the_declared_distributions(family, tmp_path):
    (undisturbed, _) = CampaignSpec(families=(family,), iid=Iid(episodes=300)).drawn()
    run = RunState(undisturbed, tmp_path)
    try:
        run.searchers.next(learning=True)
        scenes = [run.searchers.split(run.searchers.ask())[0].values for _ in range(300)]
    finally:
        run.close()
    gaps, slower = (np.array([scene[name] for scene in scenes]) for name in ("gap_m", "slower_mps"))
    assert np.quantile(gaps, 0.1) > 30  # 12 % of a uniform gap's draws are below 25
    assert np.corrcoef(gaps, slower)[0, 1] < -0.3
    assert all(gaps - 2 * slower > 0)


@pytest.mark.parametrize("exposure", [-1.0, float("nan"), float("inf")])
def test_an_exposure_that_is_none_is_refused(spec, whole, exposure):
    with pytest.raises(ConfigError) as caught:
        rates_of(spec, whole[1], exposure)
    assert caught.value.field == "exposure"


def test_a_trend_has_the_rates_that_a_run_has_written(spec, whole, tmp_path):
    write_rates(tmp_path, spec, whole[1])
    rates = read_rates(tmp_path)
    assert rates == rates_of(spec, whole[1])
    known = rates.rates[ANY].model_copy(update={"rate": 0.02, "low": 0.01, "high": 0.04})
    rates = rates.model_copy(update={"rates": {ANY: known}})
    run = EndedRun(family=spec.family, method="rate", iid=False, phases=(), versions=SOFTWARE, rates=rates)
    campaign = CampaignSpec(families=(spec.family,), methods=("rate",), ego=BLIND)
    (row,) = trend([EndedCampaign(id="c1", spec=campaign, runs=(run,))]).rows
    (rate,) = row.points[0].rates
    assert (rate.method, rate.requirement, rate.rate, rate.low, rate.high) == ("rate", None, 0.02, 0.01, 0.04)
    assert (rate.count, rate.played) == (known.failures, rates.played)


def test_draws_of_another_method_have_no_weights(spec, whole):
    with pytest.raises(ConfigError) as caught:
        rates_of(spec.model_copy(update={"method": "random"}), whole[1])
    assert caught.value.field == "method"


def test_a_rate_in_an_odd_without_mass_is_refused_and_a_search_is_not(tmp_path_factory):
    narrow = CLOSING.replace("name: closing", "name: narrow").replace(
        "odd: dynamic.ego_speed_mps}",
        "odd: dynamic.ego_speed_mps, distribution: {kind: normal, mean: 21, deviation: 0.5}}",
    )
    odd = Odd(dynamic=DynamicElements(ego_speed_mps=Interval(low=28, high=30)))
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(VARIABLE, str(tmp_path_factory.mktemp("narrow")))
        name = keep(document_from(narrow), {})
        for methods, iid in ((("rate",), None), (("random",), Iid(episodes=5))):
            with pytest.raises(ConfigError) as caught:
                checked_campaign(CampaignSpec(families=(name,), methods=methods, odd=odd, iid=iid))
            assert caught.value.field == "parameters.ego_speed_mps.distribution"
        checked_campaign(CampaignSpec(families=(name,), methods=("random",), odd=odd))


def test_axes_of_a_problem_are_those_of_its_space(spec):
    problem = Problem.from_spec(spec)
    assert tuple(axis.name for axis in problem.declared.axes) == problem.space.names


def test_the_command_answers_again_and_refuses_what_it_cannot_answer(family, tmp_path, capsys):
    command = ["rate", family, "--draws", "6", "--out", str(tmp_path), "--json"]
    assert cli.main([*command, "--exposure", "2"]) == 0
    first = json.loads(capsys.readouterr().out)
    assert (first["draws"], first["scenes_per_hour"]) == (6, 2.0)
    assert first["rates"][ANY]["why"]  # six draws are too few
    assert cli.main([*command, "--requirement", "no_contact"]) == 0
    assert list(json.loads(capsys.readouterr().out)["rates"]) == ["no_contact"]
    for wrong in (["--exposure", "-1"], ["--requirement", "no_contacts"]):
        assert cli.main([*command, *wrong]) == 2
        assert len(capsys.readouterr().err.strip().splitlines()) == 1
