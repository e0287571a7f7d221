"""This machine as a node that executes nothing: Ray lets no process in whose machine is none."""

import contextlib
import logging
import subprocess
import sys
import time
from collections.abc import Iterator

from risk_sac.errors import ConfigError
from risk_sac.execution.ray.settings import RaySettings, variable

logger = logging.getLogger(__name__)

STORE_BYTES = 80_000_000  # about the least that Ray takes; nothing but messages goes through it
STARTED = b"Ray runtime started"
LEAVE_S = 10.0


@contextlib.contextmanager
def joined(settings: RaySettings) -> Iterator[None]:
    """Joins, if that is wanted, for as long as this lasts.

    Raises:
      ConfigError: the cluster does not take it.
    """
    if not settings.ray_join:
        yield
        return
    if settings.ray_address == "auto":
        raise ConfigError("got 'auto', which is no cluster to join; wanted HOST:PORT", field=variable("ray_address"))
    process = subprocess.Popen(
        [sys.executable, "-m", "ray.scripts.scripts", "start", f"--address={settings.ray_address}", "--num-cpus=0",
         f"--object-store-memory={STORE_BYTES}", "--disable-usage-stats", "--block"],
        stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
    )  # fmt: skip
    try:
        _await(process, settings)
        yield
    finally:
        process.terminate()  # it ends what it has started
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(LEAVE_S)
        process.kill()


def _await(process: "subprocess.Popen[bytes]", settings: RaySettings) -> None:
    assert process.stdout is not None
    said = b""
    for line in process.stdout:
        said = line.strip() or said
        if STARTED in line:
            time.sleep(1.0)  # until the head knows of it
            return
    raise ConfigError(
        f"got {settings.ray_address!r}, which this machine cannot join: {said.decode(errors='replace')}",
        field=variable("ray_address"),
    )
