"""Replays the failure beside this file in SUMO, and compares all vehicles.

    python replay.py [--gui] [--sumo BINARY]

It needs Python and a SUMO with its TraCI library: `pip install eclipse-sumo`, or an installation named by SUMO_HOME.
The exit status is 0 if every vehicle is where it was, to the last bit, in every step, and 1 if not, as with another
version of SUMO. With --gui the ego is blue, and orange what strikes it or else matters most. SUMO knows no pedestrians;
they are drawn.
"""

import argparse
import json
import os
import shutil
import sys
import xml.etree.ElementTree as ET
from collections.abc import Callable
from pathlib import Path
from typing import Any

if "SUMO_HOME" in os.environ:
    sys.path.append(str(Path(os.environ["SUMO_HOME"]) / "tools"))
import traci

Commands = dict[str, Any]

HERE = Path(__file__).resolve().parent
BLUE, ORANGE = (0, 114, 178, 255), (213, 94, 0, 255)
GETTERS: dict[str, Callable[[str], float]] = {
    "x": lambda vehicle: traci.vehicle.getPosition(vehicle)[0],
    "y": lambda vehicle: traci.vehicle.getPosition(vehicle)[1],
    "angle": lambda vehicle: traci.vehicle.getAngle(vehicle),
    "speed": lambda vehicle: traci.vehicle.getSpeed(vehicle),
    "acceleration": lambda vehicle: traci.vehicle.getAcceleration(vehicle),
    "pos": lambda vehicle: traci.vehicle.getLanePosition(vehicle),
}


def main() -> int:
    """Replays it; the exit status."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--gui", action="store_true", help="in a window")
    parser.add_argument("--sumo", help="the binary (default: sumo, or sumo-gui, from the PATH)")
    options = parser.parse_args()
    name = "sumo-gui" if options.gui else "sumo"
    homes = [str(Path(home) / "bin") for home in (os.environ.get("SUMO_HOME"), Path(sys.executable).parents[1]) if home]
    binary = options.sumo or shutil.which(name) or shutil.which(name, path=os.pathsep.join(homes))
    if binary is None:
        parser.error(f"there is no {name} on the PATH; name it by --sumo")
    replayed = json.loads((HERE / "commands.json").read_bytes())
    steps = list(ET.parse(HERE / "fcd.xml").getroot())
    os.chdir(HERE)  # SUMO splits paths at commas
    command = [binary, "--configuration-file", "failure.sumocfg"]
    traci.start([*command, "--start", "--quit-on-end"] if options.gui else command)
    try:
        difference, missed = replay(replayed, steps, options.gui)
    finally:
        traci.close()
    compared = sum(len(step.findall("vehicle")) for step in steps)
    found = f"largest difference {difference:g}; {missed} missing"
    print(f"{len(steps)} steps, {compared} states of vehicles: {found}")  # noqa: T201 - a program of its own
    return int(difference > 0 or missed > 0)


def replay(replayed: Commands, steps: list[ET.Element], gui: bool) -> tuple[float, int]:
    """Returns the largest difference, and how many vehicles were elsewhere."""
    difference, missed = 0.0, 0
    for commands, recorded in zip(replayed["commands"], steps, strict=True):
        for domain, function, arguments, named in commands:
            getattr(getattr(traci, domain), function)(*arguments, **named)
        traci.simulationStep()
        wanted = {vehicle.attrib["id"]: vehicle for vehicle in recorded.findall("vehicle")}
        missed += len(wanted.keys() ^ set(traci.vehicle.getIDList()))
        for id_ in wanted.keys() & set(traci.vehicle.getIDList()):
            missed += traci.vehicle.getLaneID(id_) != wanted[id_].get("lane")
            off = (abs(get(id_) - float(wanted[id_].attrib[name])) for name, get in GETTERS.items())
            difference = max(difference, *off)
        if gui:
            show(replayed, recorded)
    return difference, missed


def show(replayed: Commands, recorded: ET.Element) -> None:
    """Colours, and the pedestrians of a step as octagons on the ground."""
    view = traci.gui.getIDList()[0]
    vehicles = traci.vehicle.getIDList()
    if replayed["ego"] in vehicles:
        traci.vehicle.setColor(replayed["ego"], BLUE)
        traci.gui.setOffset(view, *traci.vehicle.getPosition(replayed["ego"]))
        traci.gui.setZoom(view, replayed["zoom"])
    if replayed["striker"] in vehicles:
        traci.vehicle.setColor(replayed["striker"], ORANGE)
    for person in recorded.findall("person"):
        x, y, id_ = float(person.attrib["x"]), float(person.attrib["y"]), person.attrib["id"]
        ring = [(0.4, 0.15), (0.15, 0.4), (-0.15, 0.4), (-0.4, 0.15), (-0.4, -0.15), (-0.15, -0.4), (0.15, -0.4)]
        outline = [(x + dx, y + dy) for dx, dy in [*ring, (0.4, -0.15)]]
        if id_ in traci.polygon.getIDList():
            traci.polygon.setShape(id_, outline)
        else:
            traci.polygon.add(id_, outline, ORANGE if id_ == replayed["striker"] else BLUE, fill=True, layer=100)


if __name__ == "__main__":
    sys.exit(main())
