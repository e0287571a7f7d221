"""The way to the cluster: its address, its version, and whether it asks whoever comes for a token."""

import ipaddress
import logging
import os
import re
import socket

import ray
from ray.exceptions import RayError

from risk_sac.errors import ConfigError
from risk_sac.execution.ray.settings import RaySettings, variable

TOKEN_MODE = "RAY_AUTH_MODE"  # Ray's own
HEAD_S = 10.0
ADDRESS = variable("ray_address")


def check_head(settings: RaySettings) -> None:
    """Whether somebody answers where the head is wanted, before Ray itself tries for minutes.

    Raises:
      ConfigError: nobody does, or it is on a network and Ray's tokens are off.
    """
    address = settings.ray_address
    if address == "auto":
        return
    if not re.fullmatch(r"(\[[0-9A-Fa-f:]+\]|[^:/\s]+):\d{1,5}", address):
        raise ConfigError(ADDRESS, f"{address!r}", "`auto` or HOST:PORT of the head")
    host, _, port = address.rpartition(":")
    try:
        socket.create_connection((host.strip("[]"), int(port)), timeout=HEAD_S).close()
    except (OSError, OverflowError) as error:
        raise ConfigError(
            ADDRESS, f"{address!r}, where nothing answers ({error})", "HOST:PORT of the head of a Ray cluster"
        ) from error
    check_token(host)


def connect(settings: RaySettings, node: str | None) -> None:
    """Becomes a client of the cluster.

    Args:
      settings: of this process.
      node: address of this machine's node; by default Ray looks for one among the processes that it sees, the head's
        first, whatever network that is on.

    Raises:
      ConfigError: it is none, it is of another version, or it is open to other machines without a token.
    """
    try:
        ray.init(
            address=settings.ray_address,
            log_to_driver=False,
            logging_level=logging.ERROR,
            configure_logging=False,
            _node_ip_address=node,
        )
    except (ConnectionError, RuntimeError, ValueError, RayError) as error:
        why = " ".join(str(error).split())
        raise ConfigError(
            ADDRESS,
            f"{settings.ray_address!r}: {why}",
            f"the head of a cluster of Ray {ray.__version__}, with its token where {TOKEN_MODE} is set",
        ) from error
    check_token(ray.get_runtime_context().gcs_address.rpartition(":")[0])


def check_token(host: str) -> None:
    """Refuses a cluster that other machines reach, unless it wants a token.

    Raises:
      ConfigError: it has an address of a network, and Ray's tokens are off.
    """
    if os.environ.get(TOKEN_MODE) != "token" and not is_this_machine_alone(host):
        raise ConfigError(
            TOKEN_MODE,
            f"{os.environ.get(TOKEN_MODE, '')!r} with {ADDRESS} on {host}, which other machines may reach",
            f"{TOKEN_MODE}=token on all nodes, with a token in RAY_AUTH_TOKEN or RAY_AUTH_TOKEN_PATH",
        )


def is_this_machine_alone(host: str) -> bool:
    """Whether only processes of this machine reach what listens there."""
    try:
        found = {ipaddress.ip_address(entry[4][0]) for entry in socket.getaddrinfo(host.strip("[]"), None)}
    except (OSError, ValueError):
        return False
    return bool(found) and all(address.is_loopback for address in found)
