"""Replays the failure that lies beside this file in SUMO itself, and compares every vehicle with the recording.

    python replay.py [--gui] [--sumo BINARY]

It needs Python and a SUMO with its TraCI library: `pip install eclipse-sumo`, or an installation named by SUMO_HOME.
The exit status is 0 if every vehicle is where it was, to the last bit, in every step, and 1 if not, as with another
version of SUMO. With --gui the ego is blue and who strikes it orange; pedestrians, of whom SUMO knows nothing, are drawn.
"""

import argparse
import json
import os
import shutil
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

if "SUMO_HOME" in os.environ:
    sys.path.append(str(Path(os.environ["SUMO_HOME"]) / "tools"))
import traci

HERE = Path(__file__).resolve().parent
BLUE, ORANGE = (0, 114, 178, 255), (213, 94, 0, 255)
GETTERS = {
    "x": lambda vehicle: traci.vehicle.getPosition(vehicle)[0],
    "y": lambda vehicle: traci.vehicle.getPosition(vehicle)[1],
    "angle": lambda vehicle: traci.vehicle.getAngle(vehicle),
    "speed": lambda vehicle: traci.vehicle.getSpeed(vehicle),
    "acceleration": lambda vehicle: traci.vehicle.getAcceleration(vehicle),
    "pos": lambda vehicle: traci.vehicle.getLanePosition(vehicle),
}


def main():
    """Replays it; the exit status."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--gui", action="store_true", help="in a window")
    parser.add_argument("--sumo", help="the binary (default: sumo, or sumo-gui, from the PATH)")
    parser.add_argument("--picture", help="with --gui: save a picture of the last step there")
    options = parser.parse_args()
    binary = options.sumo or shutil.which("sumo-gui" if options.gui else "sumo")
    if binary is None:
        parser.error("there is no sumo on the PATH; name it by --sumo")
    told = json.loads((HERE / "commands.json").read_text())
    steps = list(ET.parse(HERE / "fcd.xml").getroot())
    command = [binary, "--configuration-file", str(HERE / "failure.sumocfg")]
    traci.start([*command, "--start", "--quit-on-end"] if options.gui else command)
    try:
        difference, missed = replay(told, steps, options)
    finally:
        traci.close()
    compared = sum(len(step.findall("vehicle")) for step in steps)
    print(f"{len(steps)} steps, {compared} states of vehicles: largest difference {difference:g}; {missed} missing")
    return int(difference > 0 or missed > 0)


def replay(told, steps, options):
    """The largest difference of any number, and how many vehicles were elsewhere than in the recording."""
    difference, missed = 0.0, 0
    for commands, recorded in zip(told["commands"], steps):
        for domain, function, arguments, named in commands:
            getattr(getattr(traci, domain), function)(*arguments, **named)
        traci.simulationStep()
        wanted = {vehicle.get("id"): vehicle for vehicle in recorded.findall("vehicle")}
        missed += len(wanted.keys() ^ set(traci.vehicle.getIDList()))
        for id_ in wanted.keys() & set(traci.vehicle.getIDList()):
            missed += traci.vehicle.getLaneID(id_) != wanted[id_].get("lane")
            off = (abs(get(id_) - float(wanted[id_].get(name))) for name, get in GETTERS.items())
            difference = max(difference, *off)
        if options.gui:
            show(told, recorded)
            if options.picture and recorded is steps[-1]:
                traci.gui.screenshot("View #0", options.picture)
                traci.simulationStep()
    return difference, missed


def show(told, recorded):
    """Colours, and the pedestrians of a step as octagons on the ground."""
    view = traci.gui.getIDList()[0]
    vehicles = traci.vehicle.getIDList()
    if told["ego"] in vehicles:
        traci.vehicle.setColor(told["ego"], BLUE)
        traci.gui.setOffset(view, *traci.vehicle.getPosition(told["ego"]))
        traci.gui.setZoom(view, told["zoom"])
    if told["striker"] in vehicles:
        traci.vehicle.setColor(told["striker"], ORANGE)
    for person in recorded.findall("person"):
        x, y, id_ = float(person.get("x")), float(person.get("y")), person.get("id")
        ring = [(0.4, 0.15), (0.15, 0.4), (-0.15, 0.4), (-0.4, 0.15), (-0.4, -0.15), (-0.15, -0.4), (0.15, -0.4)]
        outline = [(x + dx, y + dy) for dx, dy in [*ring, (0.4, -0.15)]]
        if id_ in traci.polygon.getIDList():
            traci.polygon.setShape(id_, outline)
        else:
            traci.polygon.add(id_, outline, ORANGE if id_ == told["striker"] else BLUE, fill=True, layer=100)


if __name__ == "__main__":
    sys.exit(main())
