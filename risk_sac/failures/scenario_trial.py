"""Plays a scenario document without an attack, and says what a user has to know before a search."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import closing
from itertools import pairwise

import numpy as np
import shapely
from shapely.ops import substring

from risk_sac.config import RunSpec, Scenario
from risk_sac.config.scenario import EGO
from risk_sac.env.env import RiskSacEnv
from risk_sac.env.problem import Problem
from risk_sac.errors import EgoFailed, InfeasibleScene, SimulationError
from risk_sac.records.campaign import ScenarioCheck
from risk_sac.scenario.bodies import BODIES
from risk_sac.scenario.check import check_document, scenes, without_effect
from risk_sac.scenario.families import family_of
from risk_sac.scenario.ground import net_of
from risk_sac.scenario.interpret import Interpreter
from risk_sac.scenario.layout import Layout, PedestrianStart, VehicleStart
from risk_sac.scenario.limits import Limits, limits_from_odd
from risk_sac.world.net import Net
from risk_sac.world.types import STEP_S, Role

NEAR_M = 5.0  # between the middles of two ways on which bodies may touch; choice


def out_of_reach(layouts: Sequence[Layout], limits: Limits) -> list[str]:
    """Names of the adversaries that in no scene can come near the ego's way.

    A vehicle follows lanes, over any turn, as fast as it may; what moves freely goes straight there.

    Args:
      layouts: of scenes.
      limits: of adversaries, before those of their bodies.
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
    """All lanes of a route from a start on, and the ways between them."""
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
    """All lanes that a vehicle may get to."""
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


SCENES = 20


def try_document(document: Scenario, nets: Mapping[str, str], count: int = SCENES, seed: int = 0) -> ScenarioCheck:
    """Checks a document, and plays scenes of it with the default ego and undisturbed traffic.

    Args:
      document: of the scenario.
      nets: the file of each network that it names.
      count: scenes.
      seed: of scenes and SUMO.

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
    """Lists what is to be mended, one sentence each."""
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
