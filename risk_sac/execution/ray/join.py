"""This machine as a node that executes nothing: Ray lets no process in whose machine is none."""

import contextlib
import re
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Iterator

from risk_sac.errors import ConfigError
from risk_sac.execution.ray import caretaker
from risk_sac.execution.ray.settings import RaySettings, variable

STORE_BYTES = 80_000_000  # about the least that Ray takes; nothing but messages goes through it
STARTED, ADDRESS = "Ray runtime started", re.compile(r"Local node IP: ([\w.:]+)")
START_S = 60.0  # after which Ray goes on trying
LEAVE_S = 10.0
TOLD = 8  # last lines that Ray said


@contextlib.contextmanager
def joined(settings: RaySettings) -> Iterator[str | None]:
    """Joins, if that is wanted, for as long as this lasts; should this process be killed, its node goes, too.

    Yields:
      The node's address; None if that is not wanted.

    Raises:
      ConfigError: the cluster does not take it.
    """
    if not settings.ray_join:
        yield None
        return
    if settings.ray_address == "auto":
        raise ConfigError(variable("ray_address"), "'auto', which is no cluster to join", "HOST:PORT")
    node = subprocess.Popen(
        [sys.executable, "-m", "ray.scripts.scripts", "start", f"--address={settings.ray_address}", "--num-cpus=0",
         f"--object-store-memory={STORE_BYTES}", "--disable-usage-stats", "--block"],
        stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, start_new_session=True,
    )  # fmt: skip
    watched = caretaker.Caretaker()
    watched.begin(node.pid)
    late = threading.Timer(START_S, caretaker.kill, (node.pid,))
    late.start()
    try:
        address = _address(node, settings)
        late.cancel()
        yield address
    finally:
        late.cancel()
        node.terminate()  # it ends what it has started
        with contextlib.suppress(subprocess.TimeoutExpired):
            node.wait(LEAVE_S)
        caretaker.kill(node.pid)
        watched.over(node.pid)


def _address(node: "subprocess.Popen[str]", settings: RaySettings) -> str | None:
    """Of the node, once it has started."""
    assert node.stdout is not None
    said: deque[str] = deque(maxlen=TOLD)
    address = None
    for line in node.stdout:
        said.append(line.strip())
        if found := ADDRESS.search(line):
            address = found[1]
        if STARTED in line:
            threading.Thread(target=deque, args=(node.stdout, 0), daemon=True).start()  # what else it says is not kept
            return address
    raise ConfigError(
        variable("ray_address"),
        f"got {settings.ray_address!r}, which this machine cannot join: {' '.join(filter(None, said))}",
    )
