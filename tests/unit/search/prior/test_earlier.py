"""A search that goes on from an earlier run, or is told why it cannot."""

import shutil
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

from risk_sac.config import RunSpec, SceneOptimizerConfig
from risk_sac.env.problem import Problem
from risk_sac.errors import ConfigError, DamagedError
from risk_sac.run_folder.results import EPISODES
from risk_sac.scenario import library
from risk_sac.scenario.reading import shipped_document
from risk_sac.search.prior.earlier import EarlierScripts, FamilyScripts, kept, pinned_prior
from risk_sac.search.prior.sampler import PriorOptimizer, ReplayOptimizer
from risk_sac.search.prior.shipped import inputs_of, shipped_library
from risk_sac.search.prior.start import start_of
from tests.earlier_runs import FAILURES, SAFE, run_folder


@pytest.fixture(autouse=True)
def own_library(tmp_path, monkeypatch):
    monkeypatch.setenv(library.VARIABLE, str(tmp_path / "library"))


def test_what_an_earlier_run_found_comes_first_and_its_ego_is_believed_in(tmp_path):
    prior = pinned_prior(str(run_folder(tmp_path / "v1")), ["low"])
    problem = Problem.from_spec(RunSpec(family="low", method="risk-sac-diverse", seed=0))
    shipped, start = shipped_library("low").points, start_of(problem, prior)
    assert (start.earlier, len(start.library)) == (FAILURES, FAILURES + 2 * len(shipped))
    np.testing.assert_allclose(start.library[:FAILURES], shipped[:FAILURES], atol=1e-12)
    assert start.belief.sum() == pytest.approx(1.0)
    assert start.belief.max() > 1.1 / len(start.belief)
    subject = PriorOptimizer(inputs_of("low"), SceneOptimizerConfig(), 1, start)
    for _ in range(40):
        subject.tell(subject.ask(), 0.0)
    assert {0, 1} <= set(subject.state()["played"])


def test_the_copy_outlives_its_source_and_has_the_digest_of_its_content(tmp_path):
    source = run_folder(tmp_path / "last-night")
    prior = pinned_prior(str(source), ["low"])
    assert prior == pinned_prior(str(source), ["low"])
    assert prior.startswith("last_night_")
    shutil.rmtree(source)
    assert pinned_prior(prior, ["low"]) == prior
    assert len(kept(prior).families["low"].latest) == FAILURES + SAFE
    other = run_folder(source)
    (other / EPISODES).write_text("".join((other / EPISODES).read_text().splitlines(keepends=True)[1:]))
    assert pinned_prior(str(other), ["low"]) != prior


def test_runs_that_begin_at_once_share_a_copy(tmp_path):
    source = str(run_folder(tmp_path / "v1"))
    with ThreadPoolExecutor(8) as pool:
        names = set(pool.map(lambda _: pinned_prior(source, ["low"]), range(24)))
    assert len(names) == 1
    assert kept(*names).families["low"].failures


def test_a_damaged_copy_is_refused(tmp_path):
    prior = pinned_prior(str(run_folder(tmp_path / "v1")), ["low"])
    (file,) = (tmp_path / "library").rglob("*.json")
    file.write_bytes(file.read_bytes().replace(b"0.5", b"0.6", 1) + b"\n")
    with pytest.raises(DamagedError, match=prior):
        kept(prior)


@pytest.mark.parametrize("prior", ["missing", "of-mixed", "no-scripts", "damaged", "v1_0123456789ab"])
def test_what_cannot_be_gone_on_from_is_refused_in_one_line(tmp_path, monkeypatch, prior):
    monkeypatch.chdir(tmp_path)
    run_folder(tmp_path / "of-mixed", "mixed")
    run_folder(tmp_path / "no-scripts", scripts=False)
    (run_folder(tmp_path / "damaged") / EPISODES).write_text("{}\n")
    with pytest.raises(ConfigError) as refused:
        pinned_prior(prior, ["low"])
    assert refused.value.field == "prior"
    assert "\n" not in str(refused.value)


def test_scenarios_that_are_like_one_family_share_scripts_and_their_own_come_first():
    scripts = FamilyScripts(adversaries=("lead",), mirrored=False, like="low", failures=(), latest=())
    other = replace(scripts, like="mixed")
    subject = EarlierScripts(families={"gone_000000000000": scripts, "gone_111111111111": scripts, "mixed": other})
    assert len(subject.alike("mixed")) == 1
    assert len(subject.alike("low")) == 2
    assert subject.alike("dense") == ()


def test_a_scenario_without_like_goes_on_from_its_own_scripts_alone(tmp_path):
    name = library.keep(shipped_document("low").model_copy(update={"like": None}), {})
    with pytest.raises(ConfigError):
        pinned_prior(str(run_folder(tmp_path / "low")), [name])
    prior = pinned_prior(str(run_folder(tmp_path / "own", name)), [name])
    start = start_of(Problem.from_spec(RunSpec(family=name, method="risk-sac-diverse", seed=0)), prior)
    assert (start.earlier, len(start.library)) == (FAILURES, FAILURES)
    subject = ReplayOptimizer(inputs_of("low"), SceneOptimizerConfig(), 1, start)
    for _ in range(40):
        subject.tell(subject.ask(), 0.0)
    assert set(subject.state()["played"]) <= set(range(FAILURES))
