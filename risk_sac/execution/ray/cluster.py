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

import ray
from ray.exceptions import RayError, RayTaskError
from ray.util.scheduling_strategies import NodeAffinitySchedulingStrategy

from risk_sac import __version__
from risk_sac.errors import ConfigError
from risk_sac.execution.executor import Node
from risk_sac.execution.ray.node import check, versions
from risk_sac.execution.ray.settings import ADDRESS, RaySettings, variable

logger = logging.getLogger(__name__)

TOKEN_MODE = "RAY_AUTH_MODE"  # Ray's own
HEAD_S = 10.0
PROBE_S = 60.0
START_S = 60.0  # after which Ray goes on trying to join
STORE_BYTES = 80_000_000  # about the least that Ray takes
STARTED, JOINED = "Ray runtime started", re.compile(r"Local node IP: ([\w.:]+)")


def connect(settings: RaySettings) -> None:
    """Makes this process a client of the cluster.

    Raises:
      ConfigError: nothing answers, it is no head, it has another version or token, it is open to other machines
        without a token, or a node cannot do what it will have to.
    """
    if settings.ray_address != "auto":
        _check_head(settings.ray_address)
    node = _join(settings) if settings.ray_join else None
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
    host, _, port = address.rpartition(":")
    try:
        socket.create_connection((host.strip("[]"), int(port)), timeout=HEAD_S).close()
    except (OSError, OverflowError, ValueError) as error:
        got = f"{address!r}, where nothing answers ({error})"
        raise ConfigError(ADDRESS, got, "`auto` or HOST:PORT of the head of a Ray cluster") from error
    check_token(host)


def _join(settings: RaySettings) -> str:
    """Makes this machine a node that executes nothing, since Ray lets no client in whose machine is none.

    The helper process ends the node with this process. Returns the node's address.
    """
    if settings.ray_address == "auto":
        raise ConfigError(ADDRESS, "'auto', which is no cluster to join", "HOST:PORT")
    node = subprocess.Popen(
        [sys.executable, "-m", "risk_sac.execution.helper", "0", "0", "ray.scripts.scripts", "start",
         f"--address={settings.ray_address}", "--num-cpus=0", f"--object-store-memory={STORE_BYTES}",
         "--disable-usage-stats", "--block"],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, start_new_session=True,
    )  # fmt: skip
    assert node.stdin is not None
    assert node.stdout is not None
    late = threading.Timer(START_S, node.stdin.close)
    late.start()
    said = ""
    for line in node.stdout:
        said += line
        if STARTED in line and (address := JOINED.search(said)):
            late.cancel()
            threading.Thread(target=node.stdout.read, daemon=True).start()
            return address[1]
    late.cancel()
    got = f"{settings.ray_address!r}, which this machine cannot join ({' '.join(said[-1000:].split())})"
    raise ConfigError(ADDRESS, got, "a cluster of the same Ray")


def _check_nodes(settings: RaySettings) -> None:
    """Tries every node that has room: its versions, and its folder for attempts."""
    able = [node for node in nodes(settings) if node.slots]
    if not able:
        got = f"{settings.ray_cpus_per_run:g} processors and {settings.ray_memory_bytes_per_run} bytes for a run"
        raise ConfigError(variable("ray_cpus_per_run"), f"{got}; no node of the cluster has as much")
    task = ray.remote(check)
    asked = {}
    for node in able:
        there = NodeAffinitySchedulingStrategy(node.id, soft=False)
        options = task.options(num_cpus=0, max_retries=0, scheduling_strategy=there)
        asked[options.remote(settings.ray_scratch_dir, versions())] = node.address
    for reference, address in asked.items():
        try:
            ray.get(reference, timeout=PROBE_S)
        except RayTaskError as error:
            if isinstance(error.cause, ConfigError):
                raise error.cause from None
            wanted = f"risk-sac {__version__} and all that belongs to it, as on the server's machine"
            got = f"node {address}, which cannot run what is here ({str(error.cause).partition(chr(10))[0]})"
            raise ConfigError(ADDRESS, got, wanted) from error
        except RayError as error:  # it is gone, or does not answer in time
            logger.warning("node %s was lost: %s", address, type(error).__name__)
