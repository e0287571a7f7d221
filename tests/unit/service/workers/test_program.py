from pathlib import Path

import pytest
from pydantic import ValidationError

from risk_sac.config import RunSpec
from risk_sac.execution.executor import Heard
from service.settings import ServiceSettings
from service.workers.messages import Failed, Finished, Heartbeat, Started, encode
from service.workers.program import hear, program

SPEC = RunSpec(family="low", method="random", seed=0)


def test_the_worker_is_the_one_of_the_settings_and_hears_its_folder_and_its_limits():
    settings = ServiceSettings(worker_module="other", worker_niceness=7, grace_s=1, lease_s=2, stall_s=3, replays=2)
    started = program(settings)
    assert started.arguments(SPEC, Path("/data/run")) == ["-m", "other", "/data/run", "7", str(4 << 30), "2"]
    assert (started.linger_s, started.lease_s, started.stall_s) == (1, 2, 3)
    assert started.log == "worker.log"


def test_what_a_worker_says_is_told_by_what_it_means(episode, metrics):
    stopped = Finished(finished=False, metrics=metrics, evaluation=None, digest="", versions={}, wall_s=1.0)
    assert hear(encode(Heartbeat())) == Heard(None)
    assert hear(encode(Started(pid=3))) == Heard(Started(pid=3))
    assert hear(encode(stopped)) == Heard(stopped, last=True)
    assert hear(encode(Failed(reason="no"))) == Heard(Failed(reason="no"), last=True)
    heard = hear(encode(episode(0)))
    assert (heard.progress, heard.last) == (True, False)


@pytest.mark.parametrize("line", [b"Loading net\n", b"{}\n", b"\n", b"\xff\n"])
def test_what_is_no_event_is_refused(line):
    with pytest.raises(ValidationError):
        hear(line)
    assert issubclass(ValidationError, ValueError)  # which is what an executor expects
