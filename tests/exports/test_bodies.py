"""Every body of the table, drawn, and exported in every failure format."""

import xml.etree.ElementTree as ET
from collections.abc import Callable
from dataclasses import replace

import pytest

from risk_sac.failures.export import commonroad, gif, mcap, openscenario
from risk_sac.failures.export.recorded import Recorded
from risk_sac.failures.net import thumbnail
from risk_sac.failures.recording import Recording
from risk_sac.failures.sentence import story
from risk_sac.failures.show import draw_recording
from risk_sac.scenario.bodies import BODIES, CODES, BodyName
from tests.unit.failures.staged import synthetic_contact, synthetic_series


def with_body(failure: Recorded, name: BodyName) -> Recorded:
    """The failure with another body of its striker."""
    body, actors = BODIES[name], list(failure.actors)
    striker = failure.striker
    assert striker is not None
    actors[striker] = replace(actors[striker], body=body, length_m=body.length_m, width_m=body.width_m)
    return replace(failure, actors=tuple(actors))


@pytest.mark.parametrize("name", list(BODIES))
def test_formats_call_it_what_its_row_says(name: BodyName, failure: Callable[[str], Recorded]) -> None:
    body, recorded = BODIES[name], with_body(failure("mixed"), name)
    striker = recorded.actors[recorded.striker or 0]
    scenario = ET.fromstring(openscenario.files(recorded)["failure.xosc"])
    thing = scenario.find(f".//ScenarioObject[@name='{striker.id}']/*")
    assert body.export.openscenario in [value for key, value in thing.attrib.items() if key.endswith("Category")]
    types = [each.text for file in commonroad.files(recorded).values() for each in obstacles(file)]
    assert body.export.commonroad in types
    assert gif.files(recorded)
    assert mcap.files(recorded)


def obstacles(file: bytes) -> list[ET.Element]:
    return ET.fromstring(file).findall(".//dynamicObstacle/type") if file.startswith(b"<?xml") else []


@pytest.mark.parametrize("name", list(BODIES))
def test_it_is_drawn_and_told_by_name(name: BodyName) -> None:
    body, series = BODIES[name], synthetic_series()
    series["body"][1] = CODES[name]
    series["length_m"][1], series["width_m"][1] = body.length_m, body.width_m
    recording = Recording(synthetic_contact(), series)
    assert ("<circle" in thumbnail(recording, ())) == (body.shape == "person")
    assert draw_recording("mixed", recording).axes
    assert name in story(series, recording.violation) or body.shape == "vehicle"
