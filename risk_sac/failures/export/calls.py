"""What libsumo is told during an episode, and what it makes of it: enough to have `sumo` itself do the same.

`risk_sac.sim` calls libsumo as a module, so a tap on the module hears all of it, whoever says it; a list of commands
kept here would lack the next one.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import libsumo

DOMAINS = ("route", "trafficlight", "vehicle", "vehicletype")  # in which `risk_sac.sim` gives commands
QUESTIONS = ("get", "is", "subscribe")  # what tells, and changes nothing

Call = tuple[str, str, list[Any], dict[str, Any]]
"""Domain, function, arguments, keyword arguments."""


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleState:
    """A vehicle after a step, in SUMO's own terms: the front bumper, and degrees from north, clockwise."""

    id: str
    x: float
    y: float
    angle: float
    speed: float
    acceleration: float
    type: str
    lane: str
    pos: float


@dataclass(slots=True)
class Heard:
    """An episode: how SUMO was started, the commands before each step, and the vehicles after it."""

    options: list[str] = field(default_factory=list)
    calls: list[list[Call]] = field(default_factory=lambda: [[]])
    states: list[list[VehicleState]] = field(default_factory=list)

    def first(self, steps: int) -> "Heard":
        """Without what comes after so many steps."""
        return Heard(self.options, self.calls[:steps], self.states[:steps])


@contextmanager
def tapped() -> Iterator[Heard]:
    """Hears what libsumo is told by this process, until it ends; one simulation, from its start."""
    heard, own_start, own_step = Heard(), libsumo.start, libsumo.simulationStep
    taps: list[tuple[type, str, Any]] = []

    def start(command: list[str]) -> None:
        own_start(command)
        heard.options += command[1:]

    def step(time: float = 0.0) -> None:
        own_step(time)
        heard.states.append([_state(id_) for id_ in libsumo.vehicle.getIDList()])
        heard.calls.append([])

    try:
        libsumo.start, libsumo.simulationStep = start, step
        for domain in DOMAINS:
            owner = getattr(libsumo, domain)
            for name, function in vars(owner).copy().items():
                if name.startswith(("_", *QUESTIONS)) or not isinstance(function, staticmethod):
                    continue
                taps.append((owner, name, function))
                setattr(owner, name, staticmethod(_tap(heard, domain, name, function.__func__)))
        yield heard
    finally:
        libsumo.start, libsumo.simulationStep = own_start, own_step
        for owner, name, function in taps:
            setattr(owner, name, function)


def _tap(heard: Heard, domain: str, name: str, function: Any) -> Any:
    def told(*arguments: Any, **named: Any) -> Any:
        heard.calls[-1].append((domain, name, list(arguments), named))
        return function(*arguments, **named)

    return told


def _state(id_: str) -> VehicleState:
    get = libsumo.vehicle
    x, y = get.getPosition(id_)
    return VehicleState(
        id=id_,
        x=x,
        y=y,
        angle=get.getAngle(id_),
        speed=get.getSpeed(id_),
        acceleration=get.getAcceleration(id_),
        type=get.getTypeID(id_),
        lane=get.getLaneID(id_),
        pos=get.getLanePosition(id_),
    )
