"""Tables that map our statements to published standards, by number and title.

Facts alone are taken over, no text. A clause is named by number where its number could be confirmed in a public table
of contents, else by title.

Sources: ISO 34502:2022, which is for limited access highways; its 24 scenarios of traffic disturbance are those of
Reimann et al. (arXiv:2403.18764). ISO 34503:2023; its attributes as Autoware's taxonomy of that standard has them
(github.com/autowarefoundation/odd-usecase-scenario). ISO 34505:2025; clauses 5.2 to 5.5 are in its public table of
contents, the attributes of a test case in its scope.
"""

from collections.abc import Iterator, Mapping
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from risk_sac.config import Interval, Odd
from risk_sac.scenario.families import document_named, family_named
from risk_sac.scenario.interpret import Interpreter
from risk_sac.scenario.limits import NIGHT, VISIBILITY, with_environment
from risk_sac.scenario.odd import SIGNAL_OF, field, intersect, narrow
from risk_sac.scenario.scene import motion_of
from risk_sac.scenario.space import Parameter, SceneSpace

ISO_34502 = "ISO 34502:2022, Scenario based safety evaluation framework"
ISO_34503 = "ISO 34503:2023, Specification for operational design domain"
ISO_34505 = "ISO 34505:2025, Scenario evaluation and test case generation"

ROADS = ("main", "merge", "branch")
MANOEUVRES = ("lane-keep", "lane-change")
BEHAVIOURS = ("cut-in", "cut-out", "acceleration", "deceleration")
TAG = "iso34502:"


class Functional(NamedTuple):
    """A functional scenario of ISO 34502: a disturbance by another vehicle."""

    road: str
    manoeuvre: str
    """Of the ego."""
    behaviour: str
    """Of the other vehicle."""


def functional_of(tags: tuple[str, ...]) -> Iterator[Functional]:
    """Yields the functional scenarios that a document's tags name.

    A tag is `iso34502:merge/lane-change/deceleration`; `iso34502:cut-in` alone is on the main road, the ego keeps its
    lane. Other tags are none of them.
    """
    for tag in tags:
        parts = tuple(tag.removeprefix(TAG).split("/")) if tag.startswith(TAG) else ()
        road, manoeuvre, behaviour = ("main", "lane-keep", *parts) if len(parts) == 1 else (*parts, "", "", "")[:3]
        if len(parts) in (1, 3) and road in ROADS and manoeuvre in MANOEUVRES and behaviour in BEHAVIOURS:
            yield Functional(road, manoeuvre, behaviour)


class OddAttribute(NamedTuple):
    """An attribute of ISO 34503, and what of it a scenario states."""

    branch: str
    name: str
    values: tuple[str, ...] = ()
    """Those that a scenario can have; empty if it can have none."""
    meaning: str = ""
    """Whence the value is known, or why there is none."""


def _bands(edges: tuple[float, ...]) -> tuple[str, ...]:
    return tuple(f"{low:g} to {high:g}" for low, high in pairwise(edges))


# Choice: equal bands, wide enough to be read in one row.
FRICTION_EDGES = (0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0)
VISIBILITY_EDGES_M = (40.0, 100.0, 200.0, 500.0, 1000.0, 2000.0)
SPEED_EDGES_MPS = (0.0, 5.0, 10.0, 15.0, 20.0, 25.0, 30.0, 35.0, 40.0, 60.0)
BANDS: Mapping[str, tuple[float, ...]] = {
    "surface friction": FRICTION_EDGES,
    "visibility in particulates": VISIBILITY_EDGES_M,
    "speed limit": SPEED_EDGES_MPS,
    "initial speed": SPEED_EDGES_MPS,
    "initial speed of traffic": SPEED_EDGES_MPS,
}
UNITS = {"visibility in particulates": "m"} | dict.fromkeys(
    ("speed limit", "initial speed", "initial speed of traffic"), "m/s"
)
SCENERY, ENVIRONMENT, DYNAMIC = "scenery elements", "environmental conditions", "dynamic elements"
ROAD_TAGS = ("motorway", "rural", "urban")
JUNCTION_TAGS = {"iso34502:intersection": "intersection", "roundabout": "roundabout"}
NOT_STATED = "no scenario states it"
ODD_ATTRIBUTES = (
    OddAttribute(SCENERY, "zones", (), NOT_STATED),
    OddAttribute(SCENERY, "drivable area type", (*ROAD_TAGS, "other"), "a scenario's tags"),
    OddAttribute(SCENERY, "drivable area geometry", (), "the net has it; it is not counted"),
    OddAttribute(SCENERY, "lanes of the ego's road", ("1", "2", "3", "4 or more"), "odd.scenery.lanes"),
    OddAttribute(SCENERY, "speed limit", _bands(SPEED_EDGES_MPS), "odd.scenery.speed_limit_mps"),
    OddAttribute(SCENERY, "lane markings", (), NOT_STATED),
    OddAttribute(SCENERY, "left-hand travel", (), "nets are for right-hand travel"),
    OddAttribute(SCENERY, "signals", ("none", "fixed_time"), "odd.scenery.signal_types"),
    OddAttribute(SCENERY, "other signs", (), "the net's priority holds; no sign is seen"),
    OddAttribute(SCENERY, "edges and shoulders", (), NOT_STATED),
    OddAttribute(SCENERY, "surface friction", _bands(FRICTION_EDGES), "a scenario's friction"),
    OddAttribute(SCENERY, "surface features", (), NOT_STATED),
    OddAttribute(SCENERY, "junctions", ("none", "intersection", "roundabout"), "a scenario's tags"),
    OddAttribute(SCENERY, "basic road structures", (), NOT_STATED),
    OddAttribute(SCENERY, "pedestrian crossing", ("none", "zebra", "signalised"), "odd.scenery.crossing_types"),
    OddAttribute(SCENERY, "other special structures", (), "bridges, tunnels, rail crossings and gates are not stated"),
    OddAttribute(SCENERY, "temporary structures", (), NOT_STATED),
    OddAttribute(ENVIRONMENT, "air temperature", (), NOT_STATED),
    OddAttribute(ENVIRONMENT, "wind", (), NOT_STATED),
    OddAttribute(
        ENVIRONMENT, "rainfall", ("none", "rain", "heavy_rain"), "odd.environment.precipitation; it bounds the friction"
    ),
    OddAttribute(ENVIRONMENT, "snowfall", (), NOT_STATED),
    OddAttribute(
        ENVIRONMENT, "visibility in particulates", _bands(VISIBILITY_EDGES_M), "odd.environment.visibility_m, if stated"
    ),
    OddAttribute(ENVIRONMENT, "illumination", ("day", "night"), "odd.environment.time_of_day"),
    OddAttribute(ENVIRONMENT, "cloudiness and sun", (), NOT_STATED),
    OddAttribute(ENVIRONMENT, "connectivity and positioning", (), NOT_STATED),
    OddAttribute(DYNAMIC, "motor vehicles", ("car", "van", "truck", "bus"), "bodies of a scene's actors"),
    OddAttribute(
        DYNAMIC, "vulnerable road users", ("pedestrian", "child", "bicycle", "motorcycle"), "bodies of a scene's actors"
    ),
    OddAttribute(DYNAMIC, "animals and horse riders", (), "no body of this kind"),
    OddAttribute(DYNAMIC, "special vehicles", (), "no body of this kind"),
    OddAttribute(
        DYNAMIC, "initial speed of traffic", _bands(SPEED_EDGES_MPS), "of every actor that drives in lanes, m/s"
    ),
    OddAttribute(DYNAMIC, "initial speed", _bands(SPEED_EDGES_MPS), "of the ego, m/s"),
)


class TrafficRule(NamedTuple):
    """A rule of the road, and the requirement that stands for it."""

    name: str
    requirement: str = ""
    note: str = ""


# Choice of rules; by title: Convention on Road Traffic, Vienna 1968.
TRAFFIC_RULES = (
    TrafficRule("stop at a red signal", "no_red_light_entry"),
    TrafficRule("stay on the carriageway of one's direction", "on_carriageway"),
    TrafficRule("keep a safe distance", "rss_margin", "as RSS defines it"),
    TrafficRule("keep clear of pedestrians", "pedestrian_gap", "the distance alone; not priority at a crossing"),
    TrafficRule("keep the speed limit", "", "over_limit_mps: a requirement of one's own can ask for it"),
    TrafficRule("give way at junctions", "", "no signal tells who has priority over the ego"),
    TrafficRule("stop at a stop sign", "", "no sign is seen"),
    TrafficRule("keep to lane markings", "", "no marking is seen"),
    TrafficRule("use direction indicators", "", "no indicator is modelled"),
    TrafficRule("let emergency vehicles pass", "", "no body of this kind"),
)


class Clause(NamedTuple):
    """A test case's field and the clause of a standard for it."""

    field: str
    standard: str
    clause: str
    """Number and title, or `by title` where its public scope alone names the field."""


_BY_TITLE = "by title"
_UNCONFIRMED = "not confirmed: in neither its scope nor its public contents"
CLAUSES = (
    Clause("identifier", ISO_34505, _BY_TITLE),
    Clause("scenario", ISO_34505, "5.2, Set of scenarios"),
    Clause("objective", ISO_34505, "5.5, Relation between the scenarios and test objectives"),
    Clause("functional_scenarios", ISO_34502, _BY_TITLE),
    Clause("preconditions", ISO_34505, _UNCONFIRMED),
    Clause("odd", ISO_34505, "5.4, Relation between scenarios and ODD"),
    Clause("odd", ISO_34503, _BY_TITLE),
    Clause("inputs", ISO_34505, _BY_TITLE),
    Clause("steps", ISO_34505, _BY_TITLE),
    Clause("platform", ISO_34505, _BY_TITLE),
    Clause(
        "pass_criteria", ISO_34505, "5.3, Relations between the scenarios and functional and technical requirements"
    ),
    Clause("result", ISO_34505, _BY_TITLE),
    Clause("recording", ISO_34505, _UNCONFIRMED),
    Clause("judged_by", ISO_34505, _UNCONFIRMED),
)


# Field of the ODD that is a set → attribute whose cells are its members.
SETS: Mapping[str, str] = {
    "scenery.signal_types": "signals",
    "scenery.crossing_types": "pedestrian crossing",
    "environment.precipitation": "rainfall",
}
MOTOR = ("car", "van", "truck", "bus")
VULNERABLE = ("pedestrian", "child", "bicycle", "motorcycle")
MANY_LANES = 4


class CellKey(NamedTuple):
    """Place of a cell in the matrix."""

    group: str
    row: str
    cell: str
    family: str = ""  # of a row that one scenario alone has


class SceneFacts:
    """Cells of the episodes of one scenario within one campaign's ODD."""

    def __init__(self, family: str, odd: Odd) -> None:
        self.family = family
        self._document = document_named(family)
        self._interpreter = Interpreter(self._document, {})  # for values alone, which need no net
        own = family_named(family)
        self.odd = intersect(own.odd, odd)
        self.space: SceneSpace = narrow(with_environment(own.space, odd, self.odd), self.odd)

    def cells(self, scene: Mapping[str, float]) -> set[CellKey]:
        """Returns a scene's distinct cells, without those of parameters and requirements."""
        value = self._interpreter.value(scene)
        cells = {*self._of_scenario, *self._conditions(scene)}
        speeds = {"initial speed": [value.of(self._document.ego.speed)]}
        cells.add(CellKey("bodies", "ego", value.word(self._document.ego.body)))
        for name, actor in self._document.actors.items():
            if actor.when is None or value.true(actor.when):
                body = value.word(actor.body)
                cells |= set(_bodies(actor.role, body))
                if motion_of(self._document, name, body) == "lanes":
                    speeds.setdefault("initial speed of traffic", []).append(value.of(actor.speed))
        for stream in self._document.streams.values():
            cells |= set(_bodies("background", value.word(stream.body)))
            speeds.setdefault("initial speed of traffic", []).append(value.of(stream.speed))
        speeds["surface friction"] = [value.of(self._document.friction)]
        return cells | {
            CellKey("odd", row, band_of(row, number)) for row, numbers in speeds.items() for number in numbers
        }

    @cached_property
    def _of_scenario(self) -> frozenset[CellKey]:
        tags, scenery = self._document.tags, self.odd.scenery
        cells = [CellKey("functional_scenarios", f"{f.road}, {f.manoeuvre}", f.behaviour) for f in functional_of(tags)]
        cells += [CellKey("tags", "tags", tag) for tag in tags]
        roads = [tag for tag in tags if tag in ROAD_TAGS]
        cells += [CellKey("odd", "drivable area type", road) for road in roads or ["other"]]
        junctions = {junction for tag, junction in JUNCTION_TAGS.items() if tag in tags}
        if "roundabout" in junctions:
            junctions = {"roundabout"}
        cells += [CellKey("odd", "junctions", junction) for junction in junctions or {"none"}]
        if scenery.lanes is not None:
            cells.append(CellKey("odd", "lanes of the ego's road", _lanes(scenery.lanes)))
        if scenery.speed_limit_mps is not None:
            cells.append(CellKey("odd", "speed limit", _within("speed limit", scenery.speed_limit_mps)))
        return frozenset(cells)

    def _conditions(self, scene: Mapping[str, float]) -> Iterator[CellKey]:
        categories = {parameter.odd: parameter for parameter in self.space.parameters if parameter.categories}
        for path, row in SETS.items():
            parameter, allowed = categories.get(path), field(self.odd, path) or ()
            if parameter is not None:
                yield CellKey("odd", row, parameter.categories[self._half(parameter, scene)])
            elif path == "scenery.signal_types" and (crossing := categories.get("scenery.crossing_types")):
                yield CellKey("odd", row, SIGNAL_OF[crossing.categories[self._half(crossing, scene)]])
            elif allowed:
                yield CellKey("odd", row, " or ".join(allowed))
        times = self.odd.environment.time_of_day or ()
        if NIGHT in scene:
            yield CellKey("odd", "illumination", "night" if scene[NIGHT] >= 0.5 else "day")
        elif times:
            yield CellKey("odd", "illumination", " or ".join(times))
        if VISIBILITY in scene:
            row = "visibility in particulates"
            yield CellKey("odd", row, band_of(row, scene[VISIBILITY]))

    def _half(self, parameter: Parameter, scene: Mapping[str, float]) -> int:
        """Returns the scene's half of a parameter's own range: 0 or 1."""
        own = next(one for one in self._interpreter.space.parameters if one.name == parameter.name)
        return int(scene[own.name] >= (own.low + own.high) / 2)


def band_of(row: str, number: float) -> str:
    """Returns a number's band of an attribute; beyond the edges the nearest."""
    edges = BANDS[row]
    place = int(np.clip(np.searchsorted(edges, number, side="right") - 1, 0, len(edges) - 2))
    return f"{edges[place]:g} to {edges[place + 1]:g}"


def _within(row: str, allowed: Interval) -> str:
    """Returns an interval's band, or the interval where it has several."""
    bands = {band_of(row, allowed.low), band_of(row, allowed.high)}
    return bands.pop() if len(bands) == 1 else f"within {allowed.low:.4g} to {allowed.high:.4g}"


def _lanes(allowed: Interval) -> str:
    if allowed.low != allowed.high:
        return f"within {allowed.low:g} to {allowed.high:g}"
    return f"{allowed.low:g}" if allowed.low < MANY_LANES else f"{MANY_LANES} or more"


def _bodies(role: str, body: str) -> Iterator[CellKey]:
    yield CellKey("bodies", role, body)
    for row, bodies in (("motor vehicles", MOTOR), ("vulnerable road users", VULNERABLE)):
        if body in bodies:
            yield CellKey("odd", row, body)
