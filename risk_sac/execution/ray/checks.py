"""What has to hold before the first run is ordered, told with the setting that is to blame."""

import contextlib
import ipaddress
import logging
import os
import re
import secrets
import socket
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import ray
from ray.exceptions import GetTimeoutError, RayError, RayTaskError
from ray.util.scheduling_strategies import NodeAffinitySchedulingStrategy

from risk_sac.errors import ConfigError
from risk_sac.execution.executor import Node
from risk_sac.execution.postmortem import without_folders
from risk_sac.execution.ray.attendant import differing, versions
from risk_sac.execution.ray.settings import RaySettings, variable
from risk_sac.execution.ray.storage import Place, without_secrets

TOKEN_MODE = "RAY_AUTH_MODE"  # Ray's own
PROBE_S = 60.0
HEAD_S = 10.0
ADDRESS, STORAGE = variable("ray_address"), variable("ray_storage")
PROBE = "probe-"


def connect(settings: RaySettings) -> None:
    """Becomes a client of the cluster.

    Raises:
      ConfigError: there is none at the address, it is of another version, or it is open to other machines without
        a token.
    """
    address = _address(settings.ray_address)
    if address != "auto":
        _check_answers(address)
        check_token(address.rpartition(":")[0])
    try:
        ray.init(address=address, log_to_driver=False, logging_level=logging.ERROR, configure_logging=False)
    except (ConnectionError, RuntimeError, ValueError, RayError) as error:
        raise ConfigError(
            f"got {settings.ray_address!r}: {_first(error)}; wanted the head of a cluster of Ray {ray.__version__}, "
            f"with its token where {TOKEN_MODE} is set",
            field=ADDRESS,
        ) from error
    check_token(ray.get_runtime_context().gcs_address.rpartition(":")[0])


def check_token(host: str) -> None:
    """Refuses a cluster that other machines reach, unless it wants a token.

    Raises:
      ConfigError: it has an address of a network, and Ray's tokens are off.
    """
    if os.environ.get(TOKEN_MODE) != "token" and not is_this_machine_alone(host):
        raise ConfigError(
            f"{TOKEN_MODE} is {os.environ.get(TOKEN_MODE, '')!r} and {ADDRESS} is on {host}, which other machines may "
            f"reach; wanted {TOKEN_MODE}=token on all nodes, with a token in RAY_AUTH_TOKEN or RAY_AUTH_TOKEN_PATH",
            field=TOKEN_MODE,
        )


def is_this_machine_alone(host: str) -> bool:
    """Whether only processes of this machine reach what listens there."""
    try:
        found = {ipaddress.ip_address(entry[4][0]) for entry in socket.getaddrinfo(host.strip("[]"), None)}
    except (OSError, ValueError):
        return False
    return bool(found) and all(address.is_loopback for address in found)


def check(settings: RaySettings) -> None:
    """Tries every node: its versions, its folder, its way to the storage.

    Raises:
      ConfigError: one cannot do what it will have to.
    """
    found = ray.nodes()
    able = [node for node in nodes(found, settings) if node.alive and node.slots]
    if not able:
        raise ConfigError(
            f"got {settings.ray_cpus_per_run:g} processors and {settings.ray_memory_bytes_per_run} bytes for a run; "
            "no node of the cluster has as much",
            field=variable("ray_cpus_per_run"),
        )
    place = None if settings.ray_storage is None else _probe_storage(settings.ray_storage)
    expected, probe = versions(), f"{PROBE}{secrets.token_hex(8)}"
    try:
        if place is not None:
            _write_probe(place, probe, settings)
        asked = [
            (node.address, _on(node.id, _probed).remote(settings.ray_storage, probe, str(settings.ray_scratch_dir)))
            for node in able
        ]
        for address, reference in asked:
            _check_node(address, reference, expected, settings)
    finally:
        if place is not None:
            with contextlib.suppress(OSError):  # what is wrong has been said
                place.remove(probe)


def nodes(found: Iterable[dict[str, Any]], settings: RaySettings) -> list[Node]:
    """What Ray says of its nodes, in runs."""
    listed = []
    for each in found:
        resources = each.get("Resources", {}) if each["Alive"] else {}
        slots = int(resources.get("CPU", 0) / settings.ray_cpus_per_run + 1e-9)
        if settings.ray_memory_bytes_per_run:
            slots = min(slots, int(resources.get("memory", 0) / settings.ray_memory_bytes_per_run))
        listed.append(
            Node(id=each["NodeID"], address=each["NodeManagerAddress"], alive=bool(each["Alive"]), slots=slots)
        )
    return listed


def task(function: Callable[..., Any], settings: RaySettings, name: str) -> Any:
    """A function as a task that takes what a run takes, is never repeated, and tells as it goes."""
    memory = {"memory": settings.ray_memory_bytes_per_run} if settings.ray_memory_bytes_per_run else {}
    remote: Any = ray.remote(function)
    return remote.options(
        name=name,
        num_cpus=settings.ray_cpus_per_run,
        max_retries=0,
        num_returns="streaming",
        scheduling_strategy="SPREAD",
        **memory,
    )


def _on(node: str, function: Callable[..., Any]) -> Any:
    remote: Any = ray.remote(function)
    strategy = NodeAffinitySchedulingStrategy(node, soft=False)
    return remote.options(num_cpus=0, max_retries=0, scheduling_strategy=strategy)


def _address(text: str) -> str:
    if text == "auto":
        return text
    if not re.fullmatch(r"(\[[0-9A-Fa-f:]+\]|[^:/\s]+):\d{1,5}", text):
        raise ConfigError(f"got {text!r}; wanted `auto` or HOST:PORT of the head", field=ADDRESS)
    return text


def _check_answers(address: str) -> None:
    """Ray itself would try for minutes."""
    host, _, port = address.rpartition(":")
    try:
        socket.create_connection((host.strip("[]"), int(port)), timeout=HEAD_S).close()
    except (OSError, OverflowError) as error:
        raise ConfigError(
            f"got {address!r}, where nothing answers ({error}); wanted HOST:PORT of the head of a Ray cluster",
            field=ADDRESS,
        ) from error


def _probe_storage(url: str) -> Place:
    try:
        place = Place(url)
        place.has(PROBE)
    except (OSError, ImportError, ValueError) as error:
        raise _unreachable(url, "this machine", error) from error
    return place


def _write_probe(place: Place, probe: str, settings: RaySettings) -> None:
    try:
        place.write(probe, b"server")
    except OSError as error:
        assert settings.ray_storage is not None
        raise _unreachable(settings.ray_storage, "this machine", error) from error


def _probed(storage: str | None, probe: str, scratch_dir: str) -> tuple[dict[str, str], str | None]:
    """Executed on a node: its versions, and what kept it from the storage, None if nothing did."""
    Path(scratch_dir).mkdir(parents=True, exist_ok=True, mode=0o700)
    if storage is None:
        return versions(), None
    try:
        place = Place(storage)
        mine = f"{probe}-{ray.get_runtime_context().get_node_id()}"
        place.write(mine, b"node")
        place.remove(mine)
        if place.read(probe) != b"server":
            raise OSError("it holds something else than what the server has just written")
    except (OSError, ImportError, ValueError) as error:
        return versions(), f"{type(error).__name__}: {error}"
    return versions(), None


def _check_node(address: str, reference: Any, expected: dict[str, str], settings: RaySettings) -> None:
    try:
        found, refusal = ray.get(reference, timeout=PROBE_S)
    except GetTimeoutError as error:
        raise ConfigError(f"node {address} does not answer within {PROBE_S:g} s", field=ADDRESS) from error
    except RayTaskError as error:
        raise ConfigError(f"node {address} cannot run what is here: {_first(error.cause)}", field=ADDRESS) from error
    except RayError as error:
        raise ConfigError(f"node {address} was lost: {_first(error)}", field=ADDRESS) from error
    if found != expected:
        raise ConfigError(f"on node {address}: {differing(found, expected)}", field=ADDRESS)
    if refusal is not None:
        assert settings.ray_storage is not None
        raise _unreachable(settings.ray_storage, f"node {address}", refusal)


def _unreachable(url: str, who: str, why: object) -> ConfigError:
    return ConfigError(
        f"got {without_secrets(url)!r}, which {who} cannot use ({without_folders(_first(why))}); wanted a folder or "
        "bucket that the server and all nodes read and write",
        field=STORAGE,
    )


def _first(error: object) -> str:
    return str(error).strip().partition("\n")[0] or type(error).__name__
