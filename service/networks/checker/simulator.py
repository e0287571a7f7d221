"""Whether libsumo can load a network, and what the process that tries may use."""

import os
import re
import resource
import signal
from collections.abc import Sequence
from pathlib import Path

from service.errors import UploadError
from service.networks.limits import (
    CPU_S,
    LOG_BYTES,
    MAX_EXPANDED_BYTES,
    MAX_VEHICLES,
    MEMORY_BYTES,
    OPEN_FILES,
    STEP_S,
    STEPS,
    WALL_S,
)

LOG = Path("log")  # where the file descriptors 1 and 2 lead to
_MOST_WARNINGS = 20
_LONGEST = 300
_OPTIONS = (
    "--xml-validation never --xml-validation.net never --xml-validation.routes never --route-steps 0 "
    f"--step-length {STEP_S} --max-num-vehicles {MAX_VEHICLES} --no-step-log --duration-log.disable"
).split()


def load(net: str, additionals: Sequence[str], routes: Sequence[str]) -> list[str]:
    """Loads a network and runs a few steps, with no output on and no option of the user's.

    Returns what SUMO warned of; an UploadError has SUMO's own message. All files lie in the current folder.
    """
    os.environ["OPENBLAS_NUM_THREADS"] = "1"  # libsumo imports numpy, which reserves memory for each thread
    import libsumo  # here, so that most uploads are refused without it

    command = ["sumo", "-n", net, *_OPTIONS]
    command += ["-a", ",".join(additionals)] if additionals else []
    command += ["-r", ",".join(routes)] if routes else []
    try:
        libsumo.start(command)
        for _ in range(STEPS):
            libsumo.simulationStep()
    except (libsumo.TraCIException, libsumo.FatalTraCIError) as error:
        raise UploadError(f"the simulator cannot load it: {'; '.join(said('Error')[:5]) or error}") from error
    return said("Warning")[:_MOST_WARNINGS]


def bind() -> None:
    """Bound what this process may use, for good."""
    signal.alarm(WALL_S)  # should the server die and nobody watch
    _limit(resource.RLIMIT_CORE, 0)
    _limit(resource.RLIMIT_CPU, CPU_S)
    _limit(resource.RLIMIT_AS, MEMORY_BYTES)
    _limit(resource.RLIMIT_NOFILE, OPEN_FILES)
    _limit(resource.RLIMIT_FSIZE, 2 * MAX_EXPANDED_BYTES)  # what is written anew has more end tags


def bind_simulator() -> None:
    """Leave the simulator no room for output, and no more processes or threads unless they are root's."""
    _limit(resource.RLIMIT_FSIZE, LOG_BYTES)
    _limit(resource.RLIMIT_NPROC, 0)


def _limit(resource_: int, most: int) -> None:
    _, present = resource.getrlimit(resource_)
    if present != resource.RLIM_INFINITY:
        most = min(most, present)  # only root may raise it
    resource.setrlimit(resource_, (most, most))


def said(severity: str, log: Path = LOG) -> list[str]:
    """SUMO's messages of a severity, `Error` or `Warning`, so far."""
    text = log.read_bytes().decode("utf-8", "replace")
    lines = re.findall(rf"^{severity}: (.*)$", text, re.MULTILINE)
    return ["".join(filter(str.isprintable, line))[:_LONGEST] for line in lines]
