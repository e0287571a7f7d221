"""Loads a network in libsumo, with limits on the process."""

import os
import resource
import signal
from collections.abc import Mapping, Sequence
from pathlib import Path

from risk_sac.scenario.maps.convert import FILE_BYTES, MEMORY_BYTES, limit, remarks
from service.errors import UploadError
from service.networks.limits import CPU_S, LOG_BYTES, OPEN_FILES, STEP_S, STEPS, WALL_S
from service.networks.report import Kind

LOG = Path("log")  # where the file descriptors 1 and 2 lead to
_FLAGS: Mapping[Kind, str] = {Kind.NET: "-n", Kind.ADDITIONAL: "-a", Kind.ROUTES: "-r"}
_OPTIONS = (
    "--xml-validation never --xml-validation.net never --xml-validation.routes never --route-steps 0 "
    f"--step-length {STEP_S} --scale 0 --no-step-log --duration-log.disable"  # flows insert nothing
).split()


def load(names: Mapping[Kind, Sequence[str]]) -> list[str]:
    """Loads files of the current folder and runs a few steps, without output or user options.

    Returns what SUMO warned of; an UploadError has SUMO's own message.
    """
    os.environ["OPENBLAS_NUM_THREADS"] = "1"  # libsumo imports numpy, which reserves memory for each thread
    import libsumo  # here, so that most uploads are refused without it

    command = ["sumo", *_OPTIONS]
    for kind, flag in _FLAGS.items():
        command += [flag, ",".join(names[kind])] if names[kind] else []
    try:
        libsumo.start(command)
        for _ in range(STEPS):
            libsumo.simulationStep()
    except (libsumo.TraCIException, libsumo.FatalTraCIError) as error:
        raise UploadError(f"the simulator cannot load it: {'; '.join(_said('Error')[:5]) or error}") from error
    return _said("Warning")


def bind() -> None:
    """Bound what this process may use, for good."""
    signal.alarm(WALL_S)  # in case the server dies
    limit(resource.RLIMIT_CORE, 0)
    limit(resource.RLIMIT_CPU, CPU_S)
    limit(resource.RLIMIT_AS, MEMORY_BYTES)
    limit(resource.RLIMIT_NOFILE, OPEN_FILES)
    limit(resource.RLIMIT_FSIZE, FILE_BYTES)


def bind_simulator() -> None:
    """Denies the simulator output files, and further processes or threads unless root."""
    limit(resource.RLIMIT_FSIZE, LOG_BYTES)
    limit(resource.RLIMIT_NPROC, 0)


def _said(severity: str) -> list[str]:
    """SUMO's messages of a severity, `Error` or `Warning`, so far."""
    return remarks(LOG.read_text("utf-8", "replace"), severity)
