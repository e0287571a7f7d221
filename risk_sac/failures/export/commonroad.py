"""CommonRoad XML, version 2020a: lanelets and traffic lights, everybody's trajectory, and the ego's planning problem.

In one file the ego is the planning problem alone; in the other one its recorded trajectory is an obstacle as well.
commonroad-io writes the files, in a process and an environment of its own: see `commonroad_writer.py`.
"""

import json
import subprocess
import tempfile
import xml.etree.ElementTree as ET
from itertools import groupby
from operator import itemgetter
from pathlib import Path
from typing import Any

import numpy as np

from risk_sac.failures.export.formats import Files, commonroad_python
from risk_sac.failures.export.recorded import Actor, Recorded, colour, cycle, goal
from risk_sac.failures.export.written import BESIDE, beside, document
from risk_sac.failures.net import Head, Lane, boundaries
from risk_sac.types import STEP_S

FREE, AS_RECORDED = "failure.xml", "failure-as-recorded.xml"
LACKS = (
    "requirements and how far each was kept",
    "what the ego sees",
    "the areas at corners where pedestrians walk between crossings",
    "friction",
    "the ego's driver",
    "when the adversaries were released",
)
WRITER = Path(__file__).with_name("commonroad_writer.py")
WRITES_S = 120.0  # until the writer has long ended
MADE = "2000-01-01"  # a date is required; with a true one the same failure would be another file
# Values of commonroad-io's enumerations.
LANELET_TYPES = {"road": "urban", "inside": "intersection", "sidewalk": "sidewalk", "crossing": "crosswalk"}
DIRECTIONS = {"s": "straight", "l": "left", "r": "right"}
STATES = {"red": "red", "red_yellow": "redYellow", "yellow": "yellow", "green": "green", "off": "inactive"}
LAST_STEPS = 200  # that a free ego may take after the recording
LANELETS, LIGHTS, ACTORS, PROBLEM = 1, 100_001, 200_001, 300_001  # where numbers begin


def files(failure: Recorded) -> Files:
    """Returns two scenarios, and what neither can say.

    Raises:
      OSError: the writer failed, or the folder for temporary files refuses its files.
    """
    with tempfile.TemporaryDirectory() as folder:
        done = subprocess.run(
            [commonroad_python(), "-I", WRITER, folder],
            input=json.dumps(_described(failure)),
            capture_output=True,
            text=True,
            timeout=WRITES_S,
            check=False,
        )
        if done.returncode != 0:
            reason = done.stderr.strip().rpartition("\n")[2]
            raise OSError(f"CommonRoad's scenarios cannot be written: {reason}")
        scenarios = {name: _dated(Path(folder) / name) for name in (FREE, AS_RECORDED)}
    return scenarios | {BESIDE: beside(failure, LACKS)}


def _dated(file: Path) -> bytes:
    """Returns a scenario without what differs from one export to the next."""
    root = ET.parse(file).getroot()
    root.set("date", MADE)
    tags = root.find("scenarioTags")
    assert tags is not None  # the writer gives some
    tags[:] = sorted(tags, key=lambda tag: tag.tag)  # they come from a set, in any order
    return document(root)


def _described(failure: Recorded) -> dict[str, Any]:
    """Returns what the writer reads."""
    numbers = {id_: LANELETS + place for place, id_ in enumerate(failure.net.lanes)}
    lights = _lights(failure)
    actors = [_actor(actor, ACTORS + place) for place, actor in enumerate(failure.actors)]
    target, _ = goal(failure)
    return {
        "step_s": STEP_S,
        "affiliation": f"failure {failure.name}; {BESIDE} has what is not in this file",
        "lights": list(lights.values()),
        "lanelets": _lanelets(failure, numbers, lights),
        "actors": actors,
        "problem": {
            "number": PROBLEM,
            "initial": actors[0]["states"][0],
            "goal": numbers[target.id],
            "steps": [failure.frames, failure.frames + LAST_STEPS],
        },
        "files": {FREE: [each["number"] for each in actors[1:]], AS_RECORDED: [each["number"] for each in actors]},
    }


def _lights(failure: Recorded) -> dict[Head, dict[str, Any]]:
    heads = {head: lane for lane in failure.net.lanes.values() for head in lane.heads}
    return {head: _light(failure, lane, head, LIGHTS + place) for place, (head, lane) in enumerate(heads.items())}


def _light(failure: Recorded, lane: Lane, head: Head, number: int) -> dict[str, Any]:
    shown = [(steps, STATES[colour(letters[head.index])]) for steps, letters in cycle(failure, head.signal)]
    phases = [(sum(steps for steps, _ in run), state) for state, run in groupby(shown, itemgetter(1))]
    position = boundaries(lane.centre, lane.width_m)[1][-1]
    direction = DIRECTIONS.get(head.turn, "all")
    return {"number": number, "position": position.tolist(), "cycle": phases, "direction": direction}


def _lanelets(failure: Recorded, numbers: dict[str, int], lights: dict[Head, dict[str, Any]]) -> list[dict[str, Any]]:
    net = failure.net
    before: dict[str, list[int]] = {id_: [] for id_ in net.lanes}
    for lane in net.lanes.values():
        for name in lane.next:
            before[name].append(numbers[lane.id])
    described = []
    for lane in net.lanes.values():
        left, right = boundaries(lane.centre, lane.width_m)
        beside_right, beside_left = net.neighbours(lane)
        described.append(
            {
                "number": numbers[lane.id],
                "type": LANELET_TYPES[lane.use],
                "left": left.tolist(),
                "centre": lane.centre.tolist(),
                "right": right.tolist(),
                "predecessor": before[lane.id],
                "successor": [numbers[name] for name in lane.next],
                "adjacent_left": beside_left and numbers[beside_left.id],
                "adjacent_right": beside_right and numbers[beside_right.id],
                "lights": [lights[head]["number"] for head in lane.heads],
            }
        )
    return described


def _actor(actor: Actor, number: int) -> dict[str, Any]:
    heading_rad = np.arctan2(np.sin(actor.heading_rad), np.cos(actor.heading_rad))  # within ±π
    states = [
        {
            "time_step": frame,
            "position": [float(actor.x_m[frame]), float(actor.y_m[frame])],
            "orientation": float(heading_rad[frame]),
            "velocity": float(actor.speed_mps[frame]),
            "acceleration": float(actor.accel_mps2[frame]),
        }
        for frame in range(len(actor.time_s))
    ]
    return {
        "number": number,
        "type": actor.type,
        "length_m": actor.length_m,
        "width_m": actor.width_m,
        "states": states,
    }
