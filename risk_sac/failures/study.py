"""Bundles a run's failures, and answers questions that take the simulator.

`python -m risk_sac.failures.study QUESTION ANSWER` reads the one file and writes the other.
"""

import logging
import sys
from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np

from risk_sac.config import method_of
from risk_sac.env.env import RiskSacEnv
from risk_sac.errors import CheckpointError, ConfigError, RiskSacError
from risk_sac.failures.bundle import Bundle, bundle_bytes, make_bundle
from risk_sac.failures.export.formats import FORMATS, export, packed
from risk_sac.failures.export.recorded import Recorded
from risk_sac.failures.minimise import minimise, most_plausible
from risk_sac.failures.play import repeated, twin
from risk_sac.failures.question import REFUSED, Question, TwinPlay, twin_bytes
from risk_sac.failures.recording import actions_of
from risk_sac.failures.variants import region
from risk_sac.records import EpisodeRecord
from risk_sac.run_folder.arrays import read_series
from risk_sac.run_folder.results import FAILURES, RunResults, read_results, read_verified, series_name
from risk_sac.search.frozen_policy import FrozenPolicy

logger = logging.getLogger(__name__)


def answer(question: Question) -> bytes:
    """Answers a question about a failure, as bytes.

    A bundle, a core and an export are files, a region is JSON, a twin has its time series.

    Raises:
      SimulationError: the failure does not repeat here.
    """
    spec, episode, recorded = question.spec, question.episode, read_series(question.series)
    with closing(RiskSacEnv.of(spec)) as env:
        played = repeated(env, spec, episode, recorded)
    if question.subject == "twin":
        changed = twin(spec, episode, actions_of(recorded), question.twin)
        assert episode.worst_violation is not None  # else it would have no time series
        told = TwinPlay.of(question.twin, episode.worst_violation, changed.found)
        return twin_bytes(told, changed.series)
    bundle = make_bundle(spec, episode, recorded, played.signal_heads, _policy(question))
    if question.subject == "region":
        return region(bundle).model_dump_json().encode()
    if question.subject == "export":
        assert question.format is not None  # since it asks for an export
        return packed(FORMATS[question.format], export(question.format, Recorded.of(bundle)))
    if question.subject == "most-plausible":
        return bundle_bytes(most_plausible(bundle))
    return bundle_bytes(minimise(bundle) if question.subject == "core" else bundle)


def _policy(question: Question) -> FrozenPolicy | None:
    if question.subject in ("region", "export") or not method_of(question.spec.method).learns:
        return None
    folder = question.series.parents[len(Path(FAILURES).parts)]
    try:
        return policy_of(folder, read_results(folder))
    except ConfigError:  # results are not there yet
        return None


def bundles(folder: Path, results: RunResults, episodes: Sequence[EpisodeRecord]) -> Iterator[Bundle]:
    """Yields bundles of a run's failures, each after it is replayed.

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
    """Returns a bundle of a failure as recorded, unchecked, without signal heads.

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
    """Returns a run's final policy; None if unlearned, unfinished or without checkpoint."""
    spec = results.spec
    if not method_of(spec.method).learns or not results.finished:
        return None
    from risk_sac.search.agents.learner import Learner  # imported here: torch takes half of a study's time
    from risk_sac.search.run import RunState

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


def _main(asked: Path, file: Path) -> int:
    question = Question.model_validate_json(asked.read_bytes())
    try:
        file.write_bytes(answer(question))
    except (RiskSacError, ValueError) as error:
        file.write_text(str(error), encoding="utf-8")
        return REFUSED
    return 0


if __name__ == "__main__":
    sys.exit(_main(*map(Path, sys.argv[1:])))
