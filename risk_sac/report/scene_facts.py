"""States which cells of the coverage matrix an episode lies in, by its scenario's document and its scene."""

from collections.abc import Iterator, Mapping
from functools import cached_property
from typing import NamedTuple

import numpy as np

from risk_sac.config import Interval, Odd
from risk_sac.report.standards import BANDS, JUNCTION_TAGS, ROAD_TAGS, functional_of
from risk_sac.scenario.families import document_named, family_named
from risk_sac.scenario.interpret import Interpreter
from risk_sac.scenario.limits import NIGHT, VISIBILITY, with_environment
from risk_sac.scenario.odd import SIGNAL_OF, field, intersect, narrow
from risk_sac.scenario.scene import motion_of
from risk_sac.scenario.space import Parameter, SceneSpace

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
        """Returns the cells that a scene lies in, parameters and requirements apart; the same cell once."""
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
        """Cells of all its episodes."""
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
        """Returns the half of a parameter's own range that a scene lies in: 0 or 1."""
        own = next(one for one in self._interpreter.space.parameters if one.name == parameter.name)
        return int(scene[own.name] >= (own.low + own.high) / 2)


def band_of(row: str, number: float) -> str:
    """Returns the band of an attribute that a number lies in; beyond the edges the nearest one."""
    edges = BANDS[row]
    place = int(np.clip(np.searchsorted(edges, number, side="right") - 1, 0, len(edges) - 2))
    return f"{edges[place]:g} to {edges[place + 1]:g}"


def _within(row: str, allowed: Interval) -> str:
    """Returns the band of an interval, or the interval itself where it has several."""
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
