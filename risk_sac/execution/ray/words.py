"""What server, bridge and nodes tell one another. Plain data: the server writes it as JSON, Ray pickles it."""

import json
from dataclasses import asdict, dataclass
from typing import Any

from risk_sac.execution.executor import Cause, Cluster, Exited, Node


@dataclass(frozen=True, slots=True, kw_only=True)
class Order:
    """An attempt at a run, as the server wants it."""

    number: int  # of the run
    attempt: int
    token: str  # names this attempt and no other, of this server or an earlier one
    spec: str  # of the run, JSON
    folder: str  # of the run, on the server's machine
    scratch: str  # the folder that the worker is given, on its node
    arguments: tuple[str, ...]  # for the Python interpreter
    beside: dict[str, str]  # paths on the server's machine of what the worker reads there, by their place on the node
    environment: dict[str, str]  # variables that the worker finds
    log: str
    hear: str | None  # module:function
    lease_s: float | None  # None: for ever; JSON has no infinity
    stall_s: float | None
    linger_s: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Report:
    """What a node tells of an attempt; empty ones are signs of life."""

    node: str = ""
    lines: tuple[bytes, ...] = ()  # that the worker has said
    published: bool = False  # there are newer files in the storage
    exited: Exited | None = None  # the last report


def line(kind: str, **content: Any) -> bytes:
    """One message between server and bridge."""
    return json.dumps({"kind": kind} | content).encode() + b"\n"


def order_of(content: dict[str, Any]) -> Order:
    """As it was before it went into a message."""
    return Order(**content | {"arguments": tuple(content["arguments"])})


def exited_json(exited: Exited) -> dict[str, Any]:
    """As it goes into a message."""
    return asdict(exited)


def exited_of(content: dict[str, Any]) -> Exited:
    """As it was before it went into a message."""
    return Exited(content["reason"], Cause(content["cause"]), content["status"])


def cluster_of(content: list[dict[str, Any]]) -> Cluster:
    """As it was before it went into a message."""
    return Cluster(tuple(Node(**node) for node in content))
