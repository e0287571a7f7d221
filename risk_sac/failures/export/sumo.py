"""Exports to SUMO: net, vehicle types and a replay script.

With the script the `sumo` binary repeats the states of the episode.
"""

import json
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass, field
from importlib.resources import files as resources
from pathlib import Path
from typing import Any

import libsumo
import numpy as np

from risk_sac.env.env import RiskSacEnv
from risk_sac.errors import SimulationError
from risk_sac.failures.export.formats import BESIDE, Files, beside, document
from risk_sac.failures.export.recorded import ExportedActor, Recorded
from risk_sac.failures.play import repeated
from risk_sac.world.types import STEP_S

DOMAINS = ("route", "trafficlight", "vehicle", "vehicletype")  # that `risk_sac.sim` commands
QUESTIONS = ("get", "is", "subscribe")  # beginnings of functions that change nothing
LACKS = ("pedestrians as persons of SUMO: they are points of their own dynamics", "what the ego sees", "requirements")
NET, TYPES, CONFIGURATION, FCD = "net.net.xml", "vtypes.add.xml", "failure.sumocfg", "fcd.xml"
ZOOM = 2500.0  # of sumo-gui: shows about 30 m
LONG = {"-n": "net-file", "-a": "additional-files"}
HERE = {"net-file": NET, "additional-files": TYPES}  # where they lie in the export
Call = tuple[str, str, list[Any], dict[str, Any]]
"""Domain, function, arguments, keyword arguments."""


VehicleState = dict[str, Any]
"""A vehicle after a step, in SUMO's own terms: the front bumper, and degrees from north, clockwise."""


@dataclass(slots=True)
class SumoLog:
    """SUMO's options, the commands before each step, and the vehicles after."""

    options: list[str] = field(default_factory=list)
    calls: list[list[Call]] = field(default_factory=lambda: [[]])
    states: list[list[VehicleState]] = field(default_factory=list)


@contextmanager
def _tapped() -> Iterator[SumoLog]:
    """Records this process's calls to libsumo, which `risk_sac.sim` calls as a module."""
    log = SumoLog()

    def start(command: list[str], own: Any = libsumo.start) -> None:
        own(command)
        log.options += command[1:]

    def step(time: float = 0.0, own: Any = libsumo.simulationStep) -> None:
        own(time)
        log.states.append([_state(id_) for id_ in libsumo.vehicle.getIDList()])
        log.calls.append([])

    with ExitStack() as taps:

        def tap(owner: Any, name: str, function: Any) -> None:
            taps.callback(setattr, owner, name, vars(owner)[name])
            setattr(owner, name, function)

        tap(libsumo, "start", start)
        tap(libsumo, "simulationStep", step)
        for domain in DOMAINS:
            owner = getattr(libsumo, domain)
            for name, function in vars(owner).copy().items():
                if not name.startswith(("_", *QUESTIONS)) and isinstance(function, staticmethod):
                    tap(owner, name, staticmethod(_logged(log, domain, name, function.__func__)))
        yield log


def _logged(log: SumoLog, domain: str, name: str, function: Any) -> Any:
    def logged(*arguments: Any, **named: Any) -> Any:
        log.calls[-1].append((domain, name, list(arguments), named))
        return function(*arguments, **named)

    return logged


def _state(id_: str) -> VehicleState:
    get = libsumo.vehicle
    x, y, z = get.getPosition3D(id_)
    return {
        "id": id_,
        "x": x,
        "y": y,
        "z": z,
        "angle": get.getAngle(id_),
        "speed": get.getSpeed(id_),
        "acceleration": get.getAcceleration(id_),
        "type": get.getTypeID(id_),
        "lane": get.getLaneID(id_),
        "pos": get.getLanePosition(id_),
    }


def files(failure: Recorded) -> Files:
    """Replays the failure and returns its files; `SimulationError` if it differs."""
    manifest = failure.manifest
    with _tapped() as log, closing(RiskSacEnv.of(manifest.spec)) as env:
        repeated(env, manifest.spec, manifest.episode, failure.series)
    log = SumoLog(log.options, log.calls[: failure.frames], log.states[: failure.frames])
    if len(log.states) != failure.frames:
        raise SimulationError(f"{failure.name} took {len(log.states)} steps; wanted {failure.frames}")
    types = Path(str(resources("sumo_nets") / TYPES))
    return {
        "replay.py": Path(__file__).with_name("sumo_replay.py").read_bytes(),
        CONFIGURATION: _configuration(failure, log),
        NET: failure.net_file.read_bytes(),
        TYPES: types.read_bytes(),
        "commands.json": _commands(failure, log),
        FCD: _fcd(failure, log),
        BESIDE: beside(failure, LACKS),
    }


def _configuration(failure: Recorded, log: SumoLog) -> bytes:
    root = ET.Element("configuration")
    root.append(ET.Comment(f" {failure.name}; {BESIDE} has what SUMO cannot express, replay.py plays it "))
    options = ET.SubElement(root, "options")
    for name, value in _pairs(log.options):
        ET.SubElement(options, name, value=HERE.get(name, value))
    return document(root)


def _pairs(words: Sequence[str]) -> list[tuple[str, str]]:
    """Returns names and values of command-line options; "true" for flags."""
    pairs: list[tuple[str, str]] = []
    for word in words:
        if word.startswith("-") and not word.lstrip("-")[:1].isdigit():
            pairs.append((LONG.get(word, word.removeprefix("--")), "true"))
        else:
            pairs[-1] = (pairs[-1][0], word)
    return pairs


def _commands(failure: Recorded, log: SumoLog) -> bytes:
    head = {"failure": failure.name, "ego": failure.ego.id, "striker": failure.violation.other_id, "zoom": ZOOM}
    told = ",\n".join(json.dumps(calls) for calls in log.calls)
    return f'{json.dumps(head)[:-1]}, "commands": [\n{told}\n]}}\n'.encode()


def _fcd(failure: Recorded, log: SumoLog) -> bytes:
    """Returns floating car data in SUMO's format, but in full precision."""
    root = ET.Element("fcd-export")
    root.append(ET.Comment(f" {failure.name}; {BESIDE} has what SUMO cannot express "))
    walkers = [actor for actor in failure.actors if actor.pedestrian]
    for frame, states in enumerate(log.states):
        step = ET.SubElement(root, "timestep", time=f"{(frame + 1) * STEP_S:.2f}")
        for state in states:
            ET.SubElement(step, "vehicle", {name: str(value) for name, value in state.items()})
        for walker in walkers:
            _person(step, walker, frame)
    return document(root)


def _person(step: ET.Element, walker: ExportedActor, frame: int) -> None:
    state = {
        "x": walker.x_m[frame],
        "y": walker.y_m[frame],
        "z": walker.z_m[frame],
        "angle": (90.0 - np.degrees(walker.heading_rad[frame])) % 360.0,  # from north, clockwise
        "speed": walker.speed_mps[frame],
    }
    ET.SubElement(step, "person", {"id": walker.id} | {name: repr(float(value)) for name, value in state.items()})
