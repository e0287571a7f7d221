"""Connects to a cluster and checks it before the first run.

An error names the setting to blame.
"""

import contextlib
import ipaddress
import logging
import os
import socket

import ray
from ray.exceptions import RayError, RayTaskError
from ray.util.scheduling_strategies import NodeAffinitySchedulingStrategy

from risk_sac import __version__
from risk_sac.errors import ConfigError
from risk_sac.execution.executor import ClusterNode
from risk_sac.execution.ray import ADDRESS, RaySettings, variable
from risk_sac.execution.ray.node import check, versions

logger = logging.getLogger(__name__)

TOKEN_MODE = "RAY_AUTH_MODE"  # environment variable that Ray reads
HEAD_S = 10.0
PROBE_S = 60.0


def connect(settings: RaySettings) -> None:
    """Makes this process a client of the cluster.

    Raises:
      ConfigError: nothing answers; it is no head; it has another version or token; it is open to other machines without
        a token; or a node lacks what its runs need.
    """
    if settings.ray_address != "auto":
        _check_head(settings.ray_address)
    try:
        ray.init(
            address=settings.ray_address,
            log_to_driver=False,
            logging_level=logging.ERROR,
            configure_logging=False,
        )
    except (ConnectionError, RuntimeError, ValueError, RayError) as error:
        got = f"{settings.ray_address!r}: {' '.join(str(error).split())}"
        expected = f"the head of a cluster of Ray {ray.__version__}, with its token where {TOKEN_MODE} is set"
        raise ConfigError(ADDRESS, got, expected) from error
    check_token(ray.get_runtime_context().gcs_address.rpartition(":")[0])
    _check_nodes(settings)


def nodes(settings: RaySettings) -> list[ClusterNode]:
    """The machines of the cluster, with their room for runs."""
    listed = []
    for node in ray.nodes():
        resources = node.get("Resources", {}) if node["Alive"] else {}
        slots = int(resources.get("CPU", 0) / settings.ray_cpus_per_run + 1e-9)
        if settings.ray_memory_bytes_per_run:
            slots = min(slots, int(resources.get("memory", 0) / settings.ray_memory_bytes_per_run))
        listed.append(
            ClusterNode(id=node["NodeID"], address=node["NodeManagerAddress"], alive=node["Alive"], slots=slots)
        )
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


def _check_nodes(settings: RaySettings) -> None:
    """Tries every node that has room: its versions, and its folder for attempts."""
    able = [node for node in nodes(settings) if node.slots]
    if not able:
        got = f"{settings.ray_cpus_per_run:g} processors and {settings.ray_memory_bytes_per_run} bytes for a run"
        raise ConfigError(variable("ray_cpus_per_run"), f"{got}; no node of the cluster has as much")
    task = ray.remote(check)
    asked = []
    for node in able:
        there = NodeAffinitySchedulingStrategy(node.id, soft=False)
        options = task.options(num_cpus=0, max_retries=0, scheduling_strategy=there)
        asked.append(options.remote(settings.ray_scratch_dir, versions()))
    for reference in asked:
        try:
            ray.get(reference, timeout=PROBE_S)
        except RayTaskError as error:
            if isinstance(error.cause, ConfigError):
                raise error.cause from None
            got = f"a cluster that cannot run what is here ({str(error.cause).partition(chr(10))[0]})"
            raise ConfigError(ADDRESS, got, f"risk-sac {__version__} with all its packages on each node") from error
        except RayError as error:  # it is gone, or does not answer in time
            logger.warning("a node was lost: %s", type(error).__name__)
