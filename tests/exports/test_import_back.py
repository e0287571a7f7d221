"""OpenSCENARIO exports are imported back to the same start and motion."""

import math
import xml.etree.ElementTree as ET
from types import SimpleNamespace

import numpy as np
import pytest

from risk_sac.failures.export import openscenario
from risk_sac.failures.export.formats import FormatName
from risk_sac.openscenario.scenario_file import import_scenario
from risk_sac.scenario import library
from risk_sac.scenario.ground import net_of
from risk_sac.scenario.interpret import Interpreter
from risk_sac.scenario.reading import nets_of
from risk_sac.scenario.story_scene import StoryScene, ahead_of
from tests.exports.make_examples import FAMILIES
from tests.openscenario_samples import FILES, VARIATION

NEAR_M, NEAR_RAD = 0.1, math.radians(1.0)


@pytest.mark.parametrize("family", FAMILIES)
def test_starts_and_motion_come_back(family, exported, failure, tmp_path):
    imported = import_scenario(exported(family, FormatName.OPENSCENARIO) / "failure-as-recorded.xosc")
    for name, content in imported.files.items():
        (tmp_path / name).write_bytes(content)
    document = imported.document
    of = Interpreter(document, nets_of(document, tmp_path))
    value = of.value({})
    file, net = of.net(value)
    scene = StoryScene(document, value, file, net)
    names = {given: name for name, given in document.origin.actors.items()}
    shift = np.array(net_of(file).shift_m)
    for actor in failure(family).actors:
        moving = document.ego if names[actor.id] == "ego" else document.actors[names[actor.id]]
        assert moving.body == actor.body.name
        assert (moving.box.length_m, moving.box.width_m) == pytest.approx((actor.length_m, actor.width_m))
        start = scene.middle(names[actor.id], moving.body)
        wanted = np.column_stack((actor.x_m, actor.y_m)) + shift
        assert math.dist((start.x_m, start.y_m), wanted[0]) < NEAR_M
        assert abs(math.remainder(start.heading_rad - actor.heading_rad[0], math.tau)) < NEAR_RAD
        assert value.of(moving.speed) == pytest.approx(actor.speed_mps[0], abs=0.01)
        line = scene.places.trajectory(f"{actor.id} recorded", scene.pose)
        middles = [ahead_of(line.pose(line.station_at(time_s)), moving.box.ahead_m) for time_s in actor.time_s]
        apart_m = np.hypot(*(np.array([(pose.x_m, pose.y_m) for pose in middles]) - wanted).T)
        assert apart_m.max() < NEAR_M


def test_an_imported_scenario_is_exported_with_its_own_road_and_names(failure, monkeypatch):
    recorded, shift = failure("low"), (100.0, -50.0)
    own = openscenario.World("mine.xodr", b"<OpenDRIVE/>", shift, {"ego": "Ego"}, {"ego": "wagon"})
    monkeypatch.setattr(openscenario, "own_world", lambda _: own)
    written = openscenario.files(recorded)
    assert written["mine.xodr"] == b"<OpenDRIVE/>"
    assert openscenario.ROADS not in written
    root = ET.fromstring(written[openscenario.FREE])
    assert root.find("RoadNetwork/LogicFile").get("filepath") == "mine.xodr"
    assert root.find("Entities/ScenarioObject[@name='Ego']/Vehicle").get("name") == "wagon"
    place = root.find("Storyboard/Init//Private[@entityRef='Ego']//TeleportAction/Position/WorldPosition")
    back_m = openscenario.REAR_AXLE * recorded.ego.length_m
    wanted = (
        recorded.ego.x_m[0] - back_m * math.cos(recorded.ego.heading_rad[0]) - shift[0],
        recorded.ego.y_m[0] - back_m * math.sin(recorded.ego.heading_rad[0]) - shift[1],
    )
    assert (float(place.get("x")), float(place.get("y"))) == pytest.approx(wanted, abs=0.01)


def test_the_road_and_names_are_those_of_the_imported_file(tmp_path, monkeypatch):
    monkeypatch.setenv(library.VARIABLE, str(tmp_path))
    imported = import_scenario(FILES / VARIATION)
    name = library.keep(imported.document, imported.files)
    episode = SimpleNamespace(scene={"Ego_kph": 50.0, "model": 0.1, "value_sets_1": 0.1})
    manifest = SimpleNamespace(spec=SimpleNamespace(family=name), episode=episode)
    world = openscenario.own_world(SimpleNamespace(manifest=manifest, net=SimpleNamespace(shift_m=(1.0, 2.0))))
    assert (world.road, world.content) == ("road.xodr", (FILES / "road.xodr").read_bytes())
    assert world.names["Cutting_in"] == "Cutting in"
    assert world.entries == {"ego": "wagon", "Walker": "adult"}
