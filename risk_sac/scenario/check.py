"""Checks a scenario document statically: names, units, ranges, starts and routes."""

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations

import numpy as np
import shapely

from risk_sac.config import Odd
from risk_sac.config.scenario import EGO, AllOf, Constraint, Moving, Scenario, Stream
from risk_sac.config.values import Comparison, Expression, Term, comparison, term
from risk_sac.errors import ConfigError, InfeasibleScene, did_you_mean
from risk_sac.scenario.bodies import BODIES, Body
from risk_sac.scenario.families import check_like
from risk_sac.scenario.ground import net_of
from risk_sac.scenario.interpret import Interpreter
from risk_sac.scenario.layout import LEAD_IN_S, Layout, VehicleStart
from risk_sac.scenario.odd import paths
from risk_sac.scenario.reading import alternatives
from risk_sac.scenario.scene import body_named, motion_of, steps_of
from risk_sac.scenario.story_scene import ahead_of
from risk_sac.world.net import Net
from risk_sac.world.types import Floats, Scene

UNITS = ("1", "m", "s", "m/s", "m/s²", "km", "1/m", "1/km", "1/s", "1/h", "rad", "deg", "kg", "%")
SCENES = 200  # drawn all over the space, beside the ends of each parameter
TOUCHING_M = 0.01  # by which bodies side by side may overlap


def check_document(document: Scenario, nets: Mapping[str, str]) -> None:
    """Refuses a document that cannot be played as it is written.

    Raises:
      ConfigError: with the path of the fault in the document.
    """
    of = Interpreter(document, nets)
    _check_parameters(document)
    for path, expression in document.values:
        if document.story is None:
            _check_range(term(expression), of, path, expression)
        else:  # bounds of the longer arithmetic of stories are too wide to tell
            _check_names(term(expression), of, path, expression)
    for path, text in _comparisons(document):
        if document.story is None:
            _check_range(comparison(text), of, path, text)
        else:
            _check_names(comparison(text), of, path, text)
    _check_horizon(of)
    _check_bodies(of)
    if document.like is not None:
        check_like(document.like, *of.adversaries)
    _check_layouts(of)


def scenes(of: Interpreter, count: int = SCENES) -> Iterator[Scene]:
    """Yields the middle scene, those at each parameter's ends, and random ones."""
    dimension = of.space.dimension
    middle = np.full(dimension, 0.5)
    yield of.space.from_unit(middle)
    if not dimension:
        return
    for axis in range(dimension):
        for end in (0.0, 1.0):
            yield of.space.from_unit(np.where(np.arange(dimension) == axis, end, middle))
    for point in np.random.default_rng(0).random((count, dimension)):
        yield of.space.from_unit(point)


def bodies_of(layout: Layout, net: Net, after_s: float = 0.0) -> dict[str, Floats]:
    """Corners of each actor, `4 x 2`, m, after so long.

    All go on straight at their initial speeds.
    """
    boxes = {start.id: _in_lane(start, net) for start in (layout.ego, *layout.vehicles)}
    boxes |= {start.id: _box(start.x_m, start.y_m, start.heading_rad, start.shape) for start in layout.pedestrians}
    speeds_mps = {start.id: start.speed_mps for start in (layout.ego, *layout.vehicles)}
    speeds_mps |= {start.id: start.speed_mps for start in layout.pedestrians}
    for name, speed_mps in speeds_mps.items():
        along = boxes[name][1] - boxes[name][2]
        boxes[name] = boxes[name] + along / np.linalg.norm(along) * speed_mps * after_s
    boxes |= {start.id: _box(start.x_m, start.y_m, start.heading_rad, start.shape) for start in layout.statics}
    if layout.story is not None:
        for name, start in {**layout.story.others, **layout.story.actors}.items():
            x_m, y_m, heading_rad = ahead_of(start.pose, start.reach.ahead_m + start.speed_mps * after_s)
            boxes[name] = _corners(x_m, y_m, heading_rad, start.reach.length_m, start.reach.width_m)
    return boxes


def _in_lane(start: VehicleStart, net: Net) -> Floats:
    line = np.array(net.lanes[f"{start.route[0]}_{start.lane}"].line)
    lengths = np.hypot(*np.diff(line, axis=0).T)
    stations = np.concatenate([[0.0], lengths.cumsum()])
    segment = int(np.clip(np.searchsorted(stations, start.position_m) - 1, 0, len(lengths) - 1))
    along = (line[segment + 1] - line[segment]) / lengths[segment]
    middle = line[segment] + along * (start.position_m - stations[segment] - start.shape.length_m / 2)
    return _box(float(middle[0]), float(middle[1]), math.atan2(along[1], along[0]), start.shape)


def _box(x_m: float, y_m: float, heading_rad: float, body: Body) -> Floats:
    return _corners(x_m, y_m, heading_rad, body.length_m, body.width_m)


def _corners(x_m: float, y_m: float, heading_rad: float, length_m: float, width_m: float) -> Floats:
    along = np.array((math.cos(heading_rad), math.sin(heading_rad))) * length_m / 2
    left = np.array((-math.sin(heading_rad), math.cos(heading_rad))) * width_m / 2
    return np.array((x_m, y_m)) + np.array((along + left, along - left, -along - left, -along + left))


def _check_parameters(document: Scenario) -> None:
    known = list(paths(Odd()))
    columns = [(name, own) for own, parameter in document.parameters.items() for name in parameter.names]
    before = set[str]()
    for name, parameter in document.parameters.items():
        path = f"parameters.{name}"
        if parameter.value is not None and (later := sorted(term(parameter.value).names() - before)):
            known_before = ", ".join(sorted(before)) or "there is none"
            remedy = did_you_mean(later[0], before)
            raise ConfigError(f"{path}.value", repr(later[0]), f"parameters before it: {known_before}", remedy)
        before |= {*parameter.names, name}
        if parameter.unit not in UNITS:
            # Not the closest name: that of m/s2 is m/s, that of km/h is km.
            squared = parameter.unit.replace("^", "").replace("2", "²")
            si = "values are in SI units: divide km/h by 3.6 for m/s"
            remedy = f"did you mean {squared}?" if squared in UNITS else si
            raise ConfigError(f"{path}.unit", repr(parameter.unit), f"one of {', '.join(UNITS)}", remedy)
        if parameter.odd is not None and parameter.odd not in known:
            remedy = did_you_mean(parameter.odd, known)
            raise ConfigError(f"{path}.odd", repr(parameter.odd), f"one of {', '.join(known)}", remedy)
        for column, own in columns:
            others = [other for again, other in columns if again == column and other != own]
            if (column == name != own) or others:
                got = f"a name of the rows of {own!r}, too"
                raise ConfigError(
                    path if not others else f"parameters.{others[0]}", got, "each name once", "rename one"
                )


def _check_range(of_term: Term, of: Interpreter, path: str, text: Expression) -> None:
    """Refuses unknown names, and values that do not exist within the ranges."""
    _check_names(of_term, of, path, text)
    try:
        of_term.range(of.ranges)
    except ConfigError as error:
        remedy = error.remedy or "narrow a range, or bound it with min or max"
        raise ConfigError(path, f"{text!r}: {error.got}", error.expected or "a number everywhere", remedy) from error


def _check_names(of_term: Term, of: Interpreter, path: str, text: Expression) -> None:
    if unknown := sorted(of_term.names() - of.numbers):
        name, known = unknown[0], sorted(of.numbers)
        words = name in of.document.words
        got = f"{name!r} in {text!r}, {'whose values are words' if words else 'which is no parameter'}"
        remedy = did_you_mean(name, known) or f"add it below `parameters`{'' if words else ', or write a number'}"
        raise ConfigError(path, got, f"numbers and {', '.join(known) or 'there is no parameter with numbers'}", remedy)


def _comparisons(document: Scenario) -> Iterator[tuple[str, Comparison]]:
    for i, constraint in enumerate(document.constraints):
        yield from _leaves(f"constraints[{i}]", constraint)
    for name, actor in document.actors.items():
        if actor.when is not None:
            yield f"actors.{name}.when", actor.when


def _leaves(path: str, constraint: Constraint) -> Iterator[tuple[str, Comparison]]:
    if isinstance(constraint, str):
        yield path, constraint
        return
    kind, inner = ("all", constraint.all) if isinstance(constraint, AllOf) else ("any", constraint.any)
    for i, part in enumerate(inner):
        yield from _leaves(f"{path}.{kind}[{i}]", part)


def _check_horizon(of: Interpreter) -> None:
    horizon = of.document.horizon_s
    bounds = [horizon] if isinstance(horizon, float) else list(term(horizon).range(of.ranges).model_dump().values())
    for horizon_s in bounds:
        steps_of(horizon_s)


def _check_bodies(of: Interpreter) -> None:
    document = of.document
    moving: dict[str, Moving] = {EGO: document.ego, **{f"actors.{name}": a for name, a in document.actors.items()}}
    streams: dict[str, Moving | Stream] = {f"streams.{name}": stream for name, stream in document.streams.items()}
    for path, actor in (moving | streams).items():
        for name in alternatives(of.document, actor.body):
            body = body_named(name, f"{path}.body")
            motion = motion_of(document, path.removeprefix("actors."), body) if path in moving else "lanes"
            if motion not in BODIES[body].moves and motion != "not":
                fits = [name for name, row in BODIES.items() if motion in row.moves]
                wanted = f"one that moves {motion if motion == 'freely' else 'in lanes'}: {', '.join(fits)}"
                raise ConfigError(f"{path}.body", repr(name), wanted)
    of.adversaries  # noqa: B018 # raises `ConfigError` for bodies that move differently


def _check_layouts(of: Interpreter) -> None:
    """Refuses bad places, unsatisfiable constraints and overlapping actors in sampled scenes."""
    layouts, refused = list[Layout](), list[InfeasibleScene]()
    for scene in scenes(of):
        try:
            layouts.append(of.layout(scene.values))
        except InfeasibleScene as error:
            if isinstance(error.__cause__, ConfigError) and of.document.story is None:
                raise error.__cause__ from error
            refused.append(error)
    if not layouts:
        if isinstance(refused[0].__cause__, ConfigError):
            raise refused[0].__cause__ from refused[0]
        got = f"none of {len(refused)} scenes that keeps them; in the first, {refused[0]}"
        raise ConfigError("constraints", got, "constraints that leave some scenes", "widen a range or drop one")
    _check_apart(of, layouts)


def _check_apart(of: Interpreter, layouts: Sequence[Layout]) -> None:
    met: dict[tuple[str, str], list[bool]] = {}
    for layout in layouts:
        shapes = [
            {name: shapely.Polygon(box).buffer(-TOUCHING_M, join_style="mitre") for name, box in boxes.items()}
            for boxes in (
                bodies_of(layout, net_of(layout.net), after_s)
                for after_s in ((0.0, LEAD_IN_S) if layout.story is None else (0.0,))
            )
        ]
        for one, other in combinations(shapes[0], 2):
            inside = any(at_once[one].intersects(at_once[other]) for at_once in shapes)
            met.setdefault((one, other), []).append(inside)
    for (one, other), met_in in met.items():
        if all(met_in):
            name = other if other in of.document.actors else one
            path = f"actors.{name}.start" if name in of.document.actors else f"streams.{name.rpartition('_')[0]}"
            got = f"a start inside {one if name == other else other!r} in each of {len(met_in)} scenes"
            raise ConfigError(path, got, "a start clear of it", "mind lengths: a gap is from bumper to bumper")


def without_effect(of: Interpreter, layouts: int = 5) -> list[str]:
    """Lists parameters that change no layout when only they change."""
    draw, names = np.random.default_rng(1), list[str]()
    for axis, name in enumerate(of.space.names):
        points = draw.random((layouts * 4, of.space.dimension))
        if not any(_moved(of, point, axis) for point in points):
            names.append(name)
    return names


def _moved(of: Interpreter, point: Floats, axis: int) -> bool:
    ends = list[Layout | None]()
    for end in (0.0, 1.0):
        point = point.copy()
        point[axis] = end
        try:
            ends.append(of.layout(of.space.from_unit(point).values))
        except InfeasibleScene:
            ends.append(None)
    return ends[0] != ends[1]
