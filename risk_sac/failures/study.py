"""Answers a question that takes the simulator: `python -m risk_sac.failures.study QUESTION ANSWER`, both files."""

import sys
from contextlib import closing
from pathlib import Path

from risk_sac.config import method_of
from risk_sac.env.env import RiskSacEnv
from risk_sac.errors import ConfigError, RiskSacError
from risk_sac.failures.bundle import bundle_bytes, make_bundle
from risk_sac.failures.export.formats import FORMATS, export, packed
from risk_sac.failures.export.recorded import Recorded
from risk_sac.failures.minimise import minimise
from risk_sac.failures.plausible import most_plausible
from risk_sac.failures.play import repeated, twin
from risk_sac.failures.question import REFUSED, Question, TwinPlay, twin_bytes
from risk_sac.failures.recording import actions_of
from risk_sac.failures.variants import region
from risk_sac.run_folder.arrays import read_series
from risk_sac.run_folder.results import FAILURES, read_results
from risk_sac.search.frozen_policy import FrozenPolicy


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
    """Returns the policy of the failure's run, if it learns one."""
    if question.subject in ("region", "export") or not method_of(question.spec.method).learns:
        return None
    from risk_sac.failures.collect import policy_of  # imported here: torch takes half of a study's time

    folder = question.series.parents[len(Path(FAILURES).parts)]
    try:
        return policy_of(folder, read_results(folder))
    except ConfigError:  # results are not there yet
        return None


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
