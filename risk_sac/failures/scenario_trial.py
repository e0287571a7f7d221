"""Plays a scenario document without an attack; reports problems before a search."""

from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import closing
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np
import shapely
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from shapely.ops import substring

from risk_sac.config import RunSpec, Scenario
from risk_sac.config.scenario import EGO
from risk_sac.env.env import RiskSacEnv
from risk_sac.env.problem import Problem
from risk_sac.errors import ConfigError, EgoFailed, InfeasibleScene, SimulationError
from risk_sac.failures.from_above import EGO_COLOUR, HALO, canvas, picture
from risk_sac.failures.net import surfaces
from risk_sac.records.campaign import ScenarioCheck
from risk_sac.scenario.bodies import BODIES
from risk_sac.scenario.check import bodies_of, check_document, scenes, without_effect
from risk_sac.scenario.families import family_of
from risk_sac.scenario.ground import net_of
from risk_sac.scenario.interpret import Interpreter
from risk_sac.scenario.layout import Layout, PedestrianStart, VehicleStart
from risk_sac.scenario.limits import Limits, limits_from_odd
from risk_sac.world.net import Net
from risk_sac.world.types import STEP_S, Floats, Role

NEAR_M = 5.0  # between the middles of two ways on which bodies may touch; choice


def out_of_reach(layouts: Sequence[Layout], limits: Limits) -> list[str]:
    """Names the adversaries that in no scene can approach the ego's way.

    A vehicle follows lanes, over any turn, as fast as it may; what moves freely goes straight there. `limits` are those
    before the bodies' own.
    """
    reached: dict[str, bool] = {}
    for layout in layouts:
        net, horizon_s = net_of(layout.net), layout.horizon_steps * STEP_S
        ego_way = _way(net, layout.ego, layout.ego.route, horizon_s * limits.speed_mps)
        starts: tuple[VehicleStart | PedestrianStart, ...] = (*layout.vehicles, *layout.pedestrians)
        for start in starts:
            if start.role is not Role.ADVERSARY or reached.get(start.id):
                continue
            bounds = limits.of(BODIES[start.body])
            if isinstance(start, PedestrianStart):
                there = shapely.Point(start.x_m, start.y_m)
                reach_m = horizon_s * bounds.walk_speed_mps
            else:
                there = _anywhere(net, start, horizon_s * bounds.speed_mps)
                reach_m = 2 * NEAR_M if start.uses_oncoming else 0.0
            reached[start.id] = bool(ego_way.distance(there) <= reach_m + NEAR_M)
    return [name for name, near in reached.items() if not near and name != EGO]


def _way(net: Net, start: VehicleStart, route: Sequence[str], most_m: float) -> shapely.Geometry:
    shapes = list(_rest(net, start, most_m))
    left_m = most_m - (net.edges[route[0]].lanes[0].length_m - start.position_m)
    for edge, following in pairwise(route):
        if left_m <= 0.0:
            break
        lanes = net.edges[edge].drivable
        links = [k for lane in lanes for k in net.onward.get(lane.id, ()) if k.target.edge == following]
        shapes += _lines(link.line for link in links)
        shapes += _lines(lane.line for lane in net.edges[following].drivable)
        left_m -= net.edges[following].lanes[0].length_m
    return shapely.union_all(shapes)


def _anywhere(net: Net, start: VehicleStart, most_m: float) -> shapely.Geometry:
    first = start.route[0]
    shapes, been = (
        list(_rest(net, start, most_m)),
        {first: most_m - net.edges[first].lanes[0].length_m + start.position_m},
    )
    waiting = [first]
    while waiting:
        edge = waiting.pop()
        for lane in net.edges[edge].drivable:
            for link in net.onward.get(lane.id, ()):
                following, left_m = link.target.edge, been[edge] - link.inside_m
                if been[edge] > 0.0:
                    shapes += _lines([link.line])
                if left_m > been.get(following, 0.0):
                    shapes += _lines(lane.line for lane in net.edges[following].drivable)
                    been[following] = left_m - net.edges[following].lanes[0].length_m
                    waiting.append(following)
    return shapely.union_all(shapes)


def _rest(net: Net, start: VehicleStart, most_m: float) -> Iterator[shapely.Geometry]:
    for lane in net.edges[start.route[0]].drivable:
        line = shapely.LineString(lane.line)
        yield substring(line, min(start.position_m, line.length), min(start.position_m + most_m, line.length))


def _lines(lines: Iterable[Sequence[tuple[float, float]]]) -> list[shapely.Geometry]:
    return [shapely.LineString(np.array(line)) for line in lines if len(line) > 1]


PLAYED = 20


def try_document(document: Scenario, nets: Mapping[str, str], count: int = PLAYED, seed: int = 0) -> ScenarioCheck:
    """Checks a document, and plays its scenes undisturbed with the default ego.

    `nets` has the file of each network that it names; `seed` is of scenes and SUMO.

    Raises:
      ConfigError: the document has a fault, with its path.
    """
    check_document(document, nets)
    of, family = Interpreter(document, nets), family_of(document, nets)
    spec = RunSpec(family=document.name, method="random", seed=0, requirements=document.requirements)
    problem = Problem.from_spec(spec, family)
    refused, invalid, played, contacts, steps = Counter[str](), dict[str, None](), 0, 0, 0
    with closing(RiskSacEnv(problem, spec.learner.reward, controlled=False)) as env:
        for index in range(count):
            draw = np.random.default_rng((seed, index))
            scene = problem.space.from_unit(draw.random(problem.space.dimension))
            try:
                env.reset(seed=int(draw.integers(2**31 - 1)), options={"scene": scene})
                played += 1
                ended = False
                while not ended:
                    *_, touched, truncated, _ = env.step(np.zeros(env.action_size, dtype=np.float32))
                    ended, steps, contacts = touched or truncated, steps + 1, contacts + touched
            except InfeasibleScene as infeasible:
                refused[infeasible.reason] += 1
            except (SimulationError, EgoFailed) as error:
                invalid[str(error)] = None
    checked = ScenarioCheck(
        name=document.name,
        scenes=count,
        played=played,
        refused=dict(refused),
        contacts=contacts,
        invalid=tuple(invalid),
        out_of_reach=tuple(out_of_reach(_layouts(of), limits_from_odd(family.odd, 1.0))),
        without_effect=tuple(without_effect(of)),
        seconds=round(steps * STEP_S, 1),
    )
    return checked.model_copy(update={"remarks": tuple(_remarks(checked))})


def _remarks(checked: ScenarioCheck) -> Iterator[str]:
    if checked.contacts:
        yield f"the default ego touches something in {checked.contacts} of {checked.played} scenes unattacked"
    if not checked.played:
        yield "every scene is refused: move the starts apart, or lower the speeds"
    elif 2 * checked.played < checked.scenes:
        yield f"{checked.scenes - checked.played} of {checked.scenes} scenes are refused: a search loses them"
    yield from (f"{name} cannot come near the ego's way within the horizon" for name in checked.out_of_reach)
    yield from (f"the parameter {name} changes no start" for name in checked.without_effect)
    yield from (f"an episode ended early: {why}" for why in checked.invalid)


def _layouts(of: Interpreter) -> list[Layout]:
    layouts = list[Layout]()
    for scene in scenes(of, 30):
        try:
            layouts.append(of.layout(scene.values))
        except InfeasibleScene:
            continue
    return layouts


SCENES = 60
WIDTH_IN, DPI = 6.0, 150
RATIO = (1.4, 2.4)  # least and greatest of width over height; in between it follows from the view
AROUND_M, LEAST_M = 14.0, 30.0  # of road around the actors; height of the view
AHEAD_S = 2.0  # that arrows show
SCALE_M = 20.0
COLOURS = ("tab:red", "tab:orange", "tab:green", "tab:purple", "tab:brown", "tab:pink", "tab:olive", "tab:cyan")
SURFACES = {"junction": "0.87", "lane": "0.87", "sidewalk": "0.95", "crossing": "0.72"}  # seen at 76 pixels, too
TRAFFIC = "0.55"
RANGE_ALPHA = 0.12
LABEL: dict[str, Any] = {
    "xytext": (0, 7),
    "textcoords": "offset points",
    "ha": "center",
    "fontsize": 12,
    "path_effects": HALO,
    "zorder": 4,
}


def scenario_png(document: Scenario, nets: Mapping[str, str]) -> bytes:
    """Draws a scenario; equal documents give equal bytes.

    The view holds the ego and its adversaries in the middle of all ranges. Arrows show where they are 2 s later if they
    go straight on; faint bodies show other starts. Of several nets the first scene's is drawn.

    Raises:
      ConfigError: none of the scenes is possible.
    """
    of = Interpreter(document, nets)
    starts: dict[str, list[Floats]] = defaultdict(list)
    net: Net | None = None
    ahead: dict[str, Floats] = {}
    for scene in scenes(of, SCENES):
        try:
            layout = of.layout(scene.values)
        except InfeasibleScene as infeasible:
            if isinstance(infeasible.__cause__, ConfigError):
                raise infeasible.__cause__ from infeasible
            continue
        net = net or net_of(layout.net)
        ahead = ahead or bodies_of(layout, net, AHEAD_S)
        if net is net_of(layout.net):
            for name, box in bodies_of(layout, net).items():
                starts[name if name in document.actors or name == EGO else name.rpartition("_")[0]].append(box)
    if net is None:
        raise ConfigError("constraints", "no scene that keeps them", "constraints that leave some scenes")
    (content,) = picture(partial(_figure, document, net, starts, ahead), ["png"], DPI, {})
    return content


def _figure(
    document: Scenario, net: Net, starts: Mapping[str, Sequence[Floats]], ahead: Mapping[str, Floats]
) -> Figure:
    traffic = {
        name
        for name in starts
        if name in document.streams or (name in document.actors and document.actors[name].role == "background")
    }
    acting = [name for name in starts if name not in traffic]
    low, high, ratio = _view([starts[name][0] for name in acting] + [ahead[name] for name in acting if name in ahead])
    figure = canvas((WIDTH_IN, WIDTH_IN / ratio))
    figure.set_layout_engine("none")
    axis = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axis.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
    axis.set_axis_off()
    ground = surfaces(net)
    for use, colour in SURFACES.items():
        outlines = [surface.outline for surface in ground if surface.use == use]
        axis.add_collection(PolyCollection(outlines, facecolors=colour, edgecolors="0.6", linewidths=0.4))
    colours = iter(COLOURS * (1 + len(document.actors) // len(COLOURS)))
    for name, boxes in starts.items():
        colour = EGO_COLOUR if name == EGO else TRAFFIC if name in traffic else next(colours)
        axis.add_collection(PolyCollection(boxes, facecolors=colour, edgecolors="none", alpha=RANGE_ALPHA, zorder=2))
        axis.add_collection(PolyCollection(boxes[:1], facecolors=colour, edgecolors="0.2", linewidths=0.6, zorder=3))
        start = boxes[0].mean(axis=0)
        if name in ahead and not np.allclose(ahead[name], boxes[0]):
            arrow = {"arrowstyle": "-|>", "color": colour, "linewidth": 2.0, "mutation_scale": 16, "shrinkA": 0}
            axis.annotate("", ahead[name].mean(axis=0), start, arrowprops=arrow, zorder=3, annotation_clip=False)
        if name not in traffic and (low < start).all() and (start < high).all():
            axis.annotate(name.replace("_", " "), (float(start[0]), float(start[1])), color=colour, **LABEL)
    edge_m = 0.03 * (high[0] - low[0])
    axis.plot([low[0] + edge_m, low[0] + edge_m + SCALE_M], [low[1] + edge_m] * 2, color="0.3", linewidth=2, zorder=4)
    axis.annotate(f"{SCALE_M:.0f} m", (low[0] + edge_m + SCALE_M / 2, low[1] + edge_m), color="0.3", **LABEL)
    return figure


def _view(boxes: Sequence[Floats]) -> tuple[Floats, Floats, float]:
    """Returns corners of the view around the boxes, m, and aspect ratio."""
    points = np.concatenate(boxes)
    low, high = points.min(axis=0) - AROUND_M, points.max(axis=0) + AROUND_M
    wide_m, high_m = high - low
    high_m = max(high_m, LEAST_M)
    ratio = float(np.clip(wide_m / high_m, *RATIO))
    size = np.array([max(wide_m, ratio * high_m), max(high_m, wide_m / ratio)])
    middle = (low + high) / 2
    return middle - size / 2, middle + size / 2, ratio
