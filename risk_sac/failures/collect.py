"""Makes bundles of the failures of a run, with the policy that found them."""

import logging
from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np

from risk_sac.config import method_of
from risk_sac.env.env import RiskSacEnv
from risk_sac.errors import CheckpointError
from risk_sac.failures.bundle import Bundle, make_bundle
from risk_sac.failures.play import repeated
from risk_sac.records import EpisodeRecord
from risk_sac.run_folder.arrays import read_series
from risk_sac.run_folder.results import FAILURES, RunResults, read_verified, series_name
from risk_sac.search.agents.learner import Learner
from risk_sac.search.frozen_policy import FrozenPolicy
from risk_sac.search.run import RunState

logger = logging.getLogger(__name__)


def bundles(folder: Path, results: RunResults, episodes: Sequence[EpisodeRecord]) -> Iterator[Bundle]:
    """Yields bundles of failures of a run, each after it was played again.

    Raises:
      SimulationError: a failure does not repeat.
      DamagedError, OSError: its series cannot be read.
    """
    spec, policy = results.spec, policy_of(folder, results)
    with closing(RiskSacEnv.of(spec)) as env:
        for episode in episodes:
            recorded = read_series(folder / FAILURES / series_name(episode.index))
            yield make_bundle(spec, episode, recorded, repeated(env, spec, episode, recorded).signal_heads, policy)


def recorded_bundle(folder: Path, results: RunResults, episode: EpisodeRecord, policy: FrozenPolicy | None) -> Bundle:
    """Returns a bundle of a failure as it was recorded, whether or not it repeats; without signal heads.

    By which code it was recorded is known of runs that were verified.

    Raises:
      DamagedError, OSError: its series cannot be read.
    """
    recorded = read_series(folder / FAILURES / series_name(episode.index))
    made = make_bundle(results.spec, episode, recorded, np.empty((0, 0), dtype=np.uint8), policy)
    verified = read_verified(folder, results.digest or "")
    packages = {name: version for name, version in (results.versions or {}).items() if name in made.manifest.versions}
    by = {"code": verified.code if verified else "", "versions": packages}
    return replace(made, manifest=made.manifest.model_copy(update=by))


def policy_of(folder: Path, results: RunResults) -> FrozenPolicy | None:
    """Returns a run's final policy; None if it learns none, goes on, or has no checkpoint that fits."""
    spec = results.spec
    if not method_of(spec.method).learns or not results.finished:
        return None
    with closing(RunState(spec, folder)) as run:
        try:
            resumed = run.resume()
        except CheckpointError as error:
            logger.warning("the policy of %s is left out: %s", spec.id, error)
            return None
        if not resumed:
            return None
        learner = run.searchers.agent
        assert isinstance(learner, Learner)  # since the method learns
        return learner.frozen()
