"""`python -m risk_sac.failures.study NICENESS FILE`: what takes the simulator to say of a failure.

The question is a line of JSON on stdin, the answer is written into the file. For whoever must not load the simulator.
The end of stdin means that nobody waits for the answer any more.
"""

import os
import sys
import threading
from contextlib import closing
from pathlib import Path

from risk_sac.env import RiskSacEnv
from risk_sac.errors import ConfigError, RiskSacError
from risk_sac.failures.bundle import Bundle, bundle_bytes, make_bundle
from risk_sac.failures.collect import policy_of, repeated
from risk_sac.failures.minimise import minimise
from risk_sac.failures.question import REFUSED, Question
from risk_sac.failures.recording import Recording
from risk_sac.failures.region import region
from risk_sac.failures.show import recording_bytes
from risk_sac.failures.twin import twin_recording
from risk_sac.frozen_policy import FrozenPolicy
from risk_sac.run_folder.results import FAILURES, Contact, read_results
from risk_sac.run_folder.series import read_series


def answer(question: Question) -> bytes:
    """A bundle or a core as files, a region as JSON, a failure and its twin as a picture.

    Raises:
      RiskSacError: the failure does not repeat, or cannot be played.
      ValueError: it is no contact that was judged.
    """
    if question.subject == "twin":
        return _beside_twin(question)
    bundle = _bundle(question)
    if question.subject == "region":
        return region(bundle).model_dump_json().encode()
    return bundle_bytes(minimise(bundle) if question.subject == "core" else bundle)


def _bundle(question: Question) -> Bundle:
    recorded = read_series(question.series)
    with closing(RiskSacEnv.of(question.spec)) as env:
        played = repeated(env, question.spec, question.episode, recorded)
    return make_bundle(question.spec, question.episode, recorded, played.signal_heads, _policy(question))


def _policy(question: Question) -> FrozenPolicy | None:
    """Of the run that the failure is of; a region has no use for it."""
    folder = question.series.parents[len(Path(FAILURES).parts)]
    try:
        return None if question.subject == "region" else policy_of(folder, read_results(folder))
    except ConfigError:  # results are not there yet
        return None


def _beside_twin(question: Question) -> bytes:
    contact = Contact.of(question.spec.id, question.episode)
    recorded = read_series(question.series)
    with closing(RiskSacEnv.of(question.spec)) as env:
        repeated(env, question.spec, question.episode, recorded)
    recording = Recording(contact, recorded)
    twin = twin_recording(question.spec, recording, question.twin)
    return recording_bytes(question.spec.family, recording, "png", twin)


def _main(file: Path) -> int:
    question = Question.model_validate_json(sys.stdin.buffer.readline())
    threading.Thread(target=_leave_with_asker, daemon=True).start()
    try:
        file.write_bytes(answer(question))
    except (RiskSacError, ValueError) as error:
        file.write_text(str(error))
        return REFUSED
    return 0


def _leave_with_asker() -> None:
    while os.read(0, 4096):
        pass
    os._exit(1)


if __name__ == "__main__":
    os.nice(int(sys.argv[1]))
    sys.exit(_main(Path(sys.argv[2])))
