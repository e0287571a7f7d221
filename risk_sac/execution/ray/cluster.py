"""The way to a cluster, and what has to hold before the first run, told with the setting to blame."""

import contextlib
import ipaddress
import logging
import os
import re
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from typing import Any

import ray
from ray.exceptions import GetTimeoutError, RayError, RayTaskError
from ray.util.scheduling_strategies import NodeAffinitySchedulingStrategy

from risk_sac import __version__
from risk_sac.errors import ConfigError
from risk_sac.execution.executor import Node
from risk_sac.execution.ray.caretaker import Caretaker
from risk_sac.execution.ray.node import check, versions
from risk_sac.execution.ray.settings import ADDRESS, RaySettings, variable

logger = logging.getLogger(__name__)

TOKEN_MODE = "RAY_AUTH_MODE"  # Ray's own
HEAD_S = 10.0
PROBE_S = 60.0
START_S = 60.0  # after which Ray goes on trying to join
LEAVE_S = 10.0
STORE_BYTES = 80_000_000  # about the least that Ray takes
STARTED, JOINED = "Ray runtime started", re.compile(r"Local node IP: ([\w.:]+)")


@contextlib.contextmanager
def connected(settings: RaySettings) -> Iterator[None]:
    """Makes this process a client of the cluster.

    Raises:
      ConfigError: nothing answers, it is no head, it has another version or token, it is open to other machines
        without a token, or a node cannot do what it will have to.
    """
    if settings.ray_address != "auto":
        _check_head(settings.ray_address)
    with _joined(settings) as node:
        try:
            ray.init(
                address=settings.ray_address,
                log_to_driver=False,
                logging_level=logging.ERROR,
                configure_logging=False,
                _node_ip_address=node,
            )
        except (ConnectionError, RuntimeError, ValueError, RayError) as error:
            got = f"{settings.ray_address!r}: {' '.join(str(error).split())}"
            expected = f"the head of a cluster of Ray {ray.__version__}, with its token where {TOKEN_MODE} is set"
            raise ConfigError(ADDRESS, got, expected) from error
        check_token(ray.get_runtime_context().gcs_address.rpartition(":")[0])
        _check_nodes(settings)
        yield


def nodes(settings: RaySettings) -> list[Node]:
    """The machines of the cluster, with their room for runs."""
    listed = []
    for each in ray.nodes():
        resources = each.get("Resources", {}) if each["Alive"] else {}
        slots = int(resources.get("CPU", 0) / settings.ray_cpus_per_run + 1e-9)
        if settings.ray_memory_bytes_per_run:
            slots = min(slots, int(resources.get("memory", 0) / settings.ray_memory_bytes_per_run))
        listed.append(Node(id=each["NodeID"], address=each["NodeManagerAddress"], alive=each["Alive"], slots=slots))
    return listed


def check_token(host: str) -> None:
    """Refuses a cluster that other machines reach, unless it wants a token.

    Raises:
      ConfigError: it has an address of a network, and Ray's tokens are off.
    """
    if os.environ.get(TOKEN_MODE) == "token":
        return
    with contextlib.suppress(OSError, ValueError):
        found = {ipaddress.ip_address(entry[4][0]) for entry in socket.getaddrinfo(host.strip("[]"), None)}
        if all(address.is_loopback for address in found):
            return
    raise ConfigError(
        TOKEN_MODE,
        f"{os.environ.get(TOKEN_MODE, '')!r} with {ADDRESS} on {host}, which other machines may reach",
        f"{TOKEN_MODE}=token on all nodes, with a token in RAY_AUTH_TOKEN or RAY_AUTH_TOKEN_PATH",
    )


def _check_head(address: str) -> None:
    """Asks whether anything answers, before Ray itself tries for minutes."""
    if not re.fullmatch(r"(\[[0-9A-Fa-f:]+\]|[^:/\s]+):\d{1,5}", address):
        raise ConfigError(ADDRESS, f"{address!r}", "`auto` or HOST:PORT of the head")
    host, _, port = address.rpartition(":")
    try:
        socket.create_connection((host.strip("[]"), int(port)), timeout=HEAD_S).close()
    except (OSError, OverflowError) as error:
        got = f"{address!r}, where nothing answers ({error})"
        raise ConfigError(ADDRESS, got, "HOST:PORT of the head of a Ray cluster") from error
    check_token(host)


@contextlib.contextmanager
def _joined(settings: RaySettings) -> Iterator[str | None]:
    """Makes this machine a node without room for runs, if that is wanted: Ray lets no client in whose machine is none.

    Yields:
      The node's address; None if that is not wanted.
    """
    if not settings.ray_join:
        yield None
        return
    if settings.ray_address == "auto":
        raise ConfigError(ADDRESS, "'auto', which is no cluster to join", "HOST:PORT")
    node = subprocess.Popen(
        [sys.executable, "-m", "ray.scripts.scripts", "start", f"--address={settings.ray_address}", "--num-cpus=0",
         f"--object-store-memory={STORE_BYTES}", "--disable-usage-stats", "--block"],
        stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, start_new_session=True,
    )  # fmt: skip
    caretaker = Caretaker()
    caretaker.watch(node.pid)
    late = threading.Timer(START_S, caretaker.act)
    late.start()
    try:
        yield _address(node, settings, late)
    finally:
        late.cancel()
        node.terminate()  # it ends what it has started
        with contextlib.suppress(subprocess.TimeoutExpired):
            node.wait(LEAVE_S)
        caretaker.act()


def _address(node: "subprocess.Popen[str]", settings: RaySettings, late: threading.Timer) -> str:
    assert node.stdout is not None
    said = ""
    for line in node.stdout:
        said += line
        if STARTED in line and (address := JOINED.search(said)):
            late.cancel()
            threading.Thread(target=node.stdout.read, daemon=True).start()
            return address[1]
    got = f"{settings.ray_address!r}, which this machine cannot join ({' '.join(said[-1000:].split())})"
    raise ConfigError(ADDRESS, got, "a cluster of the same Ray")


def _check_nodes(settings: RaySettings) -> None:
    """Tries every node that has room: its versions, and its folder for attempts."""
    able = [node for node in nodes(settings) if node.slots]
    if not able:
        got = f"{settings.ray_cpus_per_run:g} processors and {settings.ray_memory_bytes_per_run} bytes for a run"
        raise ConfigError(variable("ray_cpus_per_run"), f"{got}; no node of the cluster has as much")
    asked = {}
    for node in able:
        there = NodeAffinitySchedulingStrategy(node.id, soft=False)
        task = ray.remote(check).options(num_cpus=0, max_retries=0, scheduling_strategy=there)
        asked[task.remote(settings.ray_scratch_dir, versions())] = node.address
    answered = [_answers(address, reference) for reference, address in asked.items()]
    if not any(answered):
        raise ConfigError(ADDRESS, f"all nodes were lost: {', '.join(node.address for node in able)}")


def _answers(address: str, reference: Any) -> bool:
    """Passes on what a node refuses; False if it was lost, which the head tells after a while."""
    try:
        ray.get(reference, timeout=PROBE_S)
    except GetTimeoutError as error:
        raise ConfigError(ADDRESS, f"node {address} does not answer within {PROBE_S:g} s") from error
    except RayTaskError as error:
        if isinstance(error.cause, ConfigError):
            raise error.cause from None
        wanted = f"risk-sac {__version__} and all that belongs to it, as on the server's machine"
        got = f"node {address}, which cannot run what is here ({_first(error.cause)})"
        raise ConfigError(ADDRESS, got, wanted) from error
    except RayError as error:
        logger.warning("node %s was lost: %s", address, _first(error))
        return False
    return True


def _first(error: object) -> str:
    return str(error).strip().partition("\n")[0] or type(error).__name__
