"""How the worker of a run is started, heard, and met with patience."""

from collections.abc import Sequence
from pathlib import Path

from risk_sac.config import RunSpec
from risk_sac.execution.executor import Heard, Program
from service.settings import ServiceSettings
from service.workers.messages import EpisodeDone, Event, Failed, Finished, Heartbeat, decode

LOG = "worker.log"


def program(settings: ServiceSettings) -> Program[Event]:
    """The worker that the settings name."""

    def arguments(spec: RunSpec, folder: Path) -> Sequence[str]:
        numbers = settings.worker_niceness, settings.worker_memory_bytes, settings.replays
        return ["-m", settings.worker_module, str(folder), *map(str, numbers)]

    return Program(
        arguments=arguments,
        log=LOG,
        hear=hear,
        lease_s=settings.lease_s,
        stall_s=settings.stall_s,
        linger_s=settings.grace_s,
        within=settings.data_dir,
    )


def hear(line: bytes) -> Heard[Event]:
    """What one line of a worker says.

    Raises:
      pydantic.ValidationError: nothing that a worker may say; it is a ValueError.
    """
    word = decode(line)
    if isinstance(word, Heartbeat):
        return Heard(None)
    return Heard(word, progress=isinstance(word, EpisodeDone), last=isinstance(word, Finished | Failed))
