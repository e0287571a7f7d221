"""A document's fault is one line: path, value, expectation and remedy."""

from pathlib import Path
from typing import Any

import pytest
import yaml

from risk_sac.errors import ConfigError
from risk_sac.scenario.check import check_document, without_effect
from risk_sac.scenario.interpret import Interpreter
from risk_sac.scenario.reading import MOST_BYTES, document_from, nets_of, scenario_file, shipped_names

GOOD = """
name: braking
network: low
parameters:
  speed: {unit: m/s, range: [8, 16]}
  gap: {unit: m, range: [8, 50]}
  kind: {words: [car, truck]}
ego: {start: {lane: road_1, at_m: 200}, speed: speed}
actors:
  truck: {body: kind, start: {ahead_of: ego, gap_m: gap}, speed: 12}
"""


def changed(path: str, value: Any) -> str:
    """The good document with one value changed."""
    document = yaml.safe_load(GOOD)
    *parents, last = path.split(".")
    here = document
    for name in parents:
        here = here.setdefault(name, {})
    here[last] = value
    return yaml.safe_dump(document, sort_keys=False)


def checked(text: str, folder: Path | None = None) -> None:
    document = document_from(text)
    check_document(document, nets_of(document, folder))


def fault(text: str, folder: Path | None = None) -> ConfigError:
    with pytest.raises(ConfigError) as caught:
        checked(text, folder)
    return caught.value


BESIDE = {"lane": "road_0", "at_m": 200}
FAULTS: dict[str, tuple[str, Any, str]] = {  # what it is -> where it is written, the value, the path that is named
    "unknown key": ("actors.truck.colour", "red", "actors.truck.colour"),
    "unknown key of a start": ("actors.truck.start.gap", 5, "actors.truck.start.gap"),
    "unknown key at the top": ("actor", {}, "actor"),
    "unknown actor": ("actors.truck.start.ahead_of", "egg", "actors.truck.start.ahead_of"),
    "unknown lane": ("ego.start.lane", "road_7", "ego.start.lane"),
    "unknown lane of an actor": ("actors.truck.start", {"lane": "rode_1", "at_m": 5}, "actors.truck.start.lane"),
    "unknown edge of a stream": ("streams.flow", {"lane": "rode", "gap_m": 9, "speed": 9}, "streams.flow.lane"),
    "unknown edge of a route": ("ego.route", ["road", "rode"], "ego.route[1]"),
    "route that does not exist": ("ego.route", ["road", "road"], "ego.route[1]"),
    "unknown body": ("actors.truck.body", "lorry", "actors.truck.body"),
    "body that cannot drive": ("ego.body", "pedestrian", "ego.body"),
    "unknown word of a body": ("parameters.kind.words", ["car", "lorry"], "actors.truck.body"),
    "unknown parameter": ("ego.speed", "sped", "ego.speed"),
    "parameter of words in arithmetic": ("ego.speed", "kind + 1", "ego.speed"),
    "unknown parameter of a choice": ("ego.body", {"by": "knd", "of": {"car": "car"}}, "ego.body.by"),
    "unknown unit": ("parameters.speed.unit", "mph", "parameters.speed.unit"),
    "unknown field of the ODD": ("parameters.speed.odd", "dynamic.sped", "parameters.speed.odd"),
    "start beyond its lane": ("ego.start.at_m", 5000, "ego.start.at_m"),
    "start before its lane": ("ego.start.at_m", -1, "ego.start.at_m"),
    "actors inside each other": ("actors.car", {"start": {"ahead_of": "ego", "gap_m": "gap + 1"}}, "actors.car.start"),
    "actor inside the ego": ("actors.truck.start", {"beside": "ego", "ahead_m": 0}, "actors.truck.start"),
    "constraints that leave nothing": ("constraints", ["gap >= 60"], "constraints"),
    "code": ("ego.speed", "__import__('os')", "ego.speed"),
    "attribute": ("ego.speed", "speed.real", "ego.speed"),
    "comparison in a value": ("ego.speed", "speed > 3", "ego.speed"),
    "function that is not there": ("ego.speed", "exp(speed)", "ego.speed"),
    "constraint that is no comparison": ("constraints", ["gap + 1"], "constraints[0]"),
    "division by zero": ("ego.speed", "gap / (speed - 10)", "ego.speed"),
    "division by zero in a constraint": ("constraints", [{"any": ["1 / (speed - 9) > 2"]}], "constraints[0].any[0]"),
    "root of a negative number": ("ego.speed", "sqrt(speed - 10)", "ego.speed"),
    "range upside down": ("parameters.gap.range", [50, 8], "parameters.gap.range"),
    "parameter of two kinds": ("parameters.gap.value", 8, "parameters.gap"),
    "net that is not there": ("network", "moon", "network"),
    "net outside the folder": ("network", "../../etc/passwd", "network"),
    "name taken twice": ("streams.truck", {"lane": "road", "gap_m": 9, "speed": 9}, "streams.truck"),
    "name of a parameter in rows": ("parameters.two", {"rows": [{"gap": 1.0}]}, "parameters.gap"),
    "two forms of a start": ("actors.truck.start.lane", "road_1", "actors.truck.start"),
    "start without its gap": ("actors.truck.start", {"ahead_of": "ego"}, "actors.truck.start.gap_m"),
    "friction of no road": ("friction", "speed / 4", "friction"),
    "negative friction": ("friction", -1, "friction"),
    "a set speed of 0": ("set_speed", 0, "set_speed"),
    "horizon too long": ("horizon_s", "speed * 100", "horizon_s"),
    "number that is none": ("horizon_s", [1], "horizon_s"),
    "unknown family": ("like", {"family": "lo", "actors": {"truck": "lead"}}, "like.family"),
    "adversary left out of like": ("like", {"family": "low"}, "like.actors.truck"),
    "unknown actor of like": ("like", {"family": "low", "actors": {"truck": "led"}}, "like.actors.truck"),
    "no ego": ("ego", None, "ego"),
    "name that is none": ("name", "My Scenario", "name"),
    "number that is not finite": ("ego.speed", float("inf"), "ego.speed"),
}


def test_good_document_has_no_fault() -> None:
    document = document_from(GOOD)
    check_document(document, nets_of(document))


@pytest.mark.parametrize("kind", FAULTS)
def test_fault_names_its_path(kind: str) -> None:
    where, value, path = FAULTS[kind]
    error = fault(changed(where, value))
    assert error.field == path
    assert error.got
    assert error.expected or error.remedy
    assert "\n" not in str(error)


@pytest.mark.parametrize(("unit", "remedy"), [("km/h", "divide km/h by 3.6 for m/s"), ("m/s2", "did you mean m/s²?")])
def test_remedy_of_an_unknown_unit(unit: str, remedy: str) -> None:
    assert remedy in fault(changed("parameters.speed.unit", unit)).remedy


def test_start_at_an_angle_names_what_allows_it() -> None:
    start = {"lane": "road_1", "at_m": 300, "heading_deg": 90}
    assert "`moves: freely`" in fault(changed("actors.truck.start", start)).remedy


def test_cycle_of_relative_starts_is_named() -> None:
    actors = {
        "a": {"start": {"ahead_of": "b", "gap_m": 5}},
        "b": {"start": {"ahead_of": "a", "gap_m": 5}},
    }
    error = fault(changed("actors", actors))
    assert error.field == "actors.a.start"
    assert "a → b → a" in error.got


def test_ego_without_a_way_on() -> None:
    error = fault(changed("ego.start", {"lane": "road_1", "before": "lane_end", "distance_m": 5}))
    assert error.field == "ego.start"


@pytest.mark.parametrize(
    ("text", "field"),
    [
        (GOOD + "name: again\n", "name"),
        (GOOD.replace("actors:\n", "actors:\n  truck: {start: {lane: road}}\n"), "actors.truck"),
        ('{"name": "a", "name": "b"}', "name"),
        ("", ""),
        ("[1, 2]", ""),
        ("name: [", ""),
        ("a: &a [*a]\n", "a[0][0][0][0]"),
        ("x: " + "[" * 100 + "]" * 100, "x[0][0][0][0]"),
        ("{" * 100_000, ""),
        ("name: !!python/object/apply:os.system [ls]", ""),
        ("summary: " + "x" * 10_000_000, "document"),
    ],
    ids=[
        "name-twice",
        "actor-twice",
        "JSON-twice",
        "empty",
        "list",
        "broken",
        "endless",
        "deep",
        "deep-JSON",
        "code",
        "10MB",
    ],
)
def test_text_that_is_no_document(text: str, field: str) -> None:
    error = fault(text)
    assert error.field == field


def test_aliases_do_not_multiply() -> None:
    lines = ["a0: &a0 [x, x, x, x, x, x, x, x, x, x]"]
    lines += [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10)}]" for i in range(1, 9)]
    assert "aliases" in fault("\n".join(lines)).remedy


def test_longest_document_is_read() -> None:
    document_from(GOOD + "#" * (MOST_BYTES - len(GOOD)))


def test_several_faults_are_all_named() -> None:
    error = fault(GOOD.replace("road_1, at_m: 200", "road_1, at_n: 200").replace("speed: 12", "sped: 12"))
    assert {error.field, *(other.field for other in error.others)} == {"ego.start.at_n", "actors.truck.sped"}


def test_parameter_without_effect_is_named() -> None:
    document = document_from(changed("parameters.idle", {"range": [0, 1]}))
    assert without_effect(Interpreter(document, nets_of(document))) == ["idle"]


@pytest.mark.parametrize("name", shipped_names())
def test_shipped_documents_have_no_fault(name: str) -> None:
    document = document_from(scenario_file(name).read_text())
    check_document(document, nets_of(document))


@pytest.mark.parametrize(
    ("start", "path"),
    [
        ({"lane": "road_1", "at_m": 260, "lanes_left": 1}, "actors.lead.start.lanes_left"),
        ({"ahead_of": "ego", "gap_m": 20, "side": "left"}, "actors.lead.start.side"),
        ({"lane": "road_1", "at_m": 260, "setback_m": 2}, "actors.lead.start.setback_m"),
    ],
)
def test_what_would_have_no_effect_is_refused(start: dict[str, object], path: str) -> None:
    fields = {"name": "a", "network": "low", "ego": {"start": {"lane": "road_1", "at_m": 200}, "speed": 10}}
    with pytest.raises(ConfigError) as refused:
        checked(yaml.safe_dump(fields | {"actors": {"lead": {"start": start}}}))
    assert refused.value.field == path


def test_turn_that_is_none_is_refused() -> None:
    ego = {"start": {"lane": "from_south", "before": "lane_end", "distance_m": 50}, "turn": "lefft"}
    with pytest.raises(ConfigError) as refused:
        checked(yaml.safe_dump({"name": "a", "network": "dense", "ego": ego}))
    assert (refused.value.field, refused.value.expected) == ("ego.turn", "one of left, straight, right")


KERB = """
name: kerb
network: urban_street
ego: {start: {lane: eastbound_2, at_m: 100}, speed: 10}
actors:
  bus: {body: bus, start: {lane: eastbound_1, at_m: 200}}
"""


@pytest.mark.parametrize(
    ("old", "new", "path"),
    [
        ("lane: eastbound_1", "lane: eastbound_0", "actors.bus.start.lane"),  # a sidewalk
        ("eastbound_2", "eastbound_1", "ego.start.lane"),
        ("body: bus", "body: bus, role: background", "actors.bus.start.lane"),
    ],
)
def test_only_an_adversary_or_a_static_actor_starts_on_a_lane_that_is_closed_to_it(old, new, path) -> None:
    checked(KERB)
    checked(KERB.replace("body: bus", "body: bus, role: static"))
    checked(KERB.replace("{lane: eastbound_1, at_m: 200}", "{beside: ego, lanes_left: -1, ahead_m: 50}"))
    assert fault(KERB.replace(old, new)).field == path
