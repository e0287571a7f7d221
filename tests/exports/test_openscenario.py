"""OpenSCENARIO and OpenDRIVE before ASAM's checkers, and read back."""

import json
import xml.etree.ElementTree as ET
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
import shapely
from lxml import etree
from shapely.affinity import rotate, translate

from risk_sac.failures.export.formats import FormatName
from risk_sac.failures.export.recorded import ExportedActor
from risk_sac.failures.net import colour
from tests.exports.conftest import CM, ask_checkers, checked
from tests.exports.make_examples import FAMILIES
from tests.exports.read_opendrive import dangling, middles

FILES = ("failure.xosc", "failure-as-recorded.xosc", "roads.xodr")
LEFT_OUT = {"check_asam_xodr_junctions_connection_one_link_to_incoming"}  # of OpenDRIVE up to 1.3
CHECKS = {".xosc": 17, ".xodr": 23}


@checked
def test_asams_checkers_find_nothing(exported):
    files = [exported(family, FormatName.OPENSCENARIO) / name for family in FAMILIES for name in FILES]
    for file, checks in json.loads(ask_checkers("ask_asam.py", *files)).items():
        assert len(checks) == CHECKS[Path(file).suffix]
        for check, (state, findings) in checks.items():
            assert state == ("skipped" if check in LEFT_OUT else "completed"), (file, check)
            assert findings == [], (file, check)


def driven(file: Path, actor: ExportedActor) -> np.ndarray:
    """Returns times and middles of a body, `frames x 3`."""
    root = etree.parse(file).getroot()
    (trajectory,) = (each for each in root.iter("Trajectory") if each.get("name") == f"{actor.id} recorded")
    (thing,) = (each for each in root.iter("ScenarioObject") if each.get("name") == actor.id)
    ahead_m = float(thing.find(".//BoundingBox/Center").get("x"))
    found = []
    for vertex in trajectory.iter("Vertex"):
        place = vertex.find(".//WorldPosition")
        x, y, heading = (float(place.get(name)) for name in ("x", "y", "h"))
        found.append((float(vertex.get("time")), x + ahead_m * np.cos(heading), y + ahead_m * np.sin(heading)))
    return np.array(found)


@pytest.mark.parametrize("family", FAMILIES)
def test_trajectories_come_back_within_a_centimetre(family, exported, failure):
    folder, recorded = exported(family, FormatName.OPENSCENARIO), failure(family)
    for actor in recorded.actors:
        found = driven(folder / "failure-as-recorded.xosc", actor)
        wanted = np.column_stack((actor.time_s, actor.x_m, actor.y_m))
        assert np.abs(found - wanted).max() < CM
        boxes = (
            etree.parse(folder / "failure.xosc")
            .getroot()
            .iterfind(f".//ScenarioObject[@name='{actor.id}']//Dimensions")
        )
        assert [(float(box.get("length")), float(box.get("width"))) for box in boxes] == [
            (actor.length_m, actor.width_m)
        ]


@pytest.mark.parametrize("family", FAMILIES)
def test_no_two_bodies_overlap_before_the_end_as_a_reader_of_the_standard_draws_them(family, exported):
    bodies = drawn_bodies(exported(family, FormatName.OPENSCENARIO) / "failure-as-recorded.xosc")
    last_s = max(max(at) for at in bodies.values())
    for a, b in combinations(bodies, 2):
        for time_s in bodies[a].keys() & bodies[b].keys():
            if "ego" not in (a, b) or time_s < last_s:
                assert not bodies[a][time_s].intersects(bodies[b][time_s]), (a, b, time_s)


def drawn_bodies(file: Path) -> dict[str, dict[float, shapely.Polygon]]:
    """Entity → time → outline of its bounding box."""
    root = etree.parse(file).getroot()
    found: dict[str, dict[float, shapely.Polygon]] = {}
    for thing in root.iter("ScenarioObject"):
        name, box = thing.get("name"), thing.find(".//BoundingBox")
        ahead_m = float(box.find("Center").get("x"))
        length_m, width_m = (float(box.find("Dimensions").get(side)) for side in ("length", "width"))
        outline = shapely.box(ahead_m - length_m / 2, -width_m / 2, ahead_m + length_m / 2, width_m / 2)
        (trajectory,) = (each for each in root.iter("Trajectory") if each.get("name") == f"{name} recorded")
        for vertex in trajectory.iter("Vertex"):
            x, y, heading = (float(vertex.find(".//WorldPosition").get(key)) for key in ("x", "y", "h"))
            turned = rotate(outline, heading, origin=(0, 0), use_radians=True)
            found.setdefault(name, {})[round(float(vertex.get("time")), 3)] = translate(turned, x, y)
    return found


@pytest.mark.parametrize("family", FAMILIES)
def test_the_ego_is_free_and_knows_where_to_go_and_nobody_else_is(family, exported, failure):
    root = etree.parse(exported(family, FormatName.OPENSCENARIO) / "failure.xosc").getroot()
    follow = {each.get("entityRef") for each in root.iter("EntityRef") if each.getparent().tag == "Actors"}
    assert follow == {actor.id for actor in failure(family).actors[1:]}
    (asked,) = root.iter("AcquirePositionAction")
    assert next(asked.iterancestors("Private")).get("entityRef") == "ego"
    assert "beside.json" in root.find("FileHeader").get("description")


@pytest.mark.parametrize("family", ["mixed", "dense"])
def test_signals_show_what_they_showed_in_every_frame(family, exported, failure):
    recorded = failure(family)
    root = etree.parse(exported(family, FormatName.OPENSCENARIO) / "failure.xosc").getroot()
    drawn = {
        each.get("id") for each in etree.parse(exported(family, FormatName.OPENSCENARIO) / "roads.xodr").iter("signal")
    }
    (controller,) = root.iter("TrafficSignalController")
    shown: list[dict[str, str]] = []
    for phase in controller.iter("Phase"):
        states = {state.get("trafficSignalId"): state.get("state") for state in phase.iter("TrafficSignalState")}
        assert states.keys() == drawn
        shown += [states] * round(float(phase.get("duration")) * 10)
    letters = recorded.heads[controller.get("name")]
    for frame in range(recorded.frames):
        for name, state in shown[frame].items():
            assert state == colour(chr(letters[frame, int(name.rpartition("_")[2])]))


@pytest.mark.parametrize("family", FAMILIES)
def test_lanes_come_back_within_a_centimetre(family, exported, failure):
    root = ET.parse(exported(family, FormatName.OPENSCENARIO) / "roads.xodr").getroot()
    lines = [shapely.LineString(line[:, :2]) for line in middles(root)]
    assert dangling(root) == []
    for lane in failure(family).net.lanes.values():
        if lane.use != "crossing":  # that is an object beside the lanes in OpenDRIVE
            points = shapely.points(lane.centre)
            assert min(shapely.distance(points, line).max() for line in lines) < CM, lane.id
