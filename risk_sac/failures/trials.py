"""Plays an ego or a place without an attack, to check them.

It tells whether a registered ego, or a place of a map, is fit for a search.
"""

import math
from collections import Counter
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, Literal

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from risk_sac.config import EgoConfig, RunSpec
from risk_sac.egos.pilot import EgoPilot
from risk_sac.env.env import RiskSacEnv
from risk_sac.env.problem import Problem
from risk_sac.errors import ConfigError, EgoFailed, InfeasibleScene, SimulationError
from risk_sac.failures.from_above import EGO_COLOUR, SURFACE_COLOURS, canvas, legend, picture
from risk_sac.failures.net import roads_of
from risk_sac.failures.play import play
from risk_sac.failures.recording import Series
from risk_sac.maps.found import Fit
from risk_sac.records import Record
from risk_sac.scenario.families import family_named
from risk_sac.scenario.layout import Layout, PedestrianStart
from risk_sac.search.agents.controls import RandomAgent
from risk_sac.sim.solid import Walker
from risk_sac.sim.sumo import SumoSimulation
from risk_sac.world.geometry import relative_view
from risk_sac.world.types import OFFSET, STEP_S, Role, Scene, Signal

TRIES = 100  # scenes that are drawn where the middle of the space is unsafe
STANDING_MPS = 0.3
LEAST_M = 1.0  # an ego that drives less in the second half of all scenes does not move
MARGIN_M = 15.0
WIDTH_IN, HIGHEST_IN, DPI = 10.0, 8.0, 110
SLACK = 1e-6
METHOD: Literal["no-adversary"] = "no-adversary"


class EgoTrial(Record):
    """An ego's drive through a scene in which nothing attacks."""

    scenario: str
    failed: str = ""
    """Why it could not drive on; empty if it could."""
    steps: int = 0
    driven_m: float = 0.0
    driven_late_m: float = 0.0
    """In the second half."""
    stood_s: float = 0.0
    decision_ratio: float = 0.0
    """Real time of a decision as a share of the step of 0.1 s: the median."""
    worst_ratio: float = 0.0
    """Without the first decision, which loads code."""
    late: int = 0
    """Decisions, without the first, that took longer than the step."""
    clipped: int = 0
    """Commands beyond the limits of the car."""
    farthest_offset_m: float = 0.0
    """From the middle of its path."""
    contact: str = ""
    """Name of what it touched."""
    violated: tuple[str, ...] = ()
    """Requirements that count."""


def unusable(trials: Sequence[EgoTrial]) -> list[str]:
    """Returns reasons why an ego is unfit for a search, or none."""
    reasons = [f"{trial.scenario}: {trial.failed}" for trial in trials if trial.failed]
    reasons += [f"{trial.scenario}: it touches {trial.contact} without an attack" for trial in trials if trial.contact]
    drove = [trial for trial in trials if not trial.failed]
    if drove and all(trial.driven_late_m < LEAST_M for trial in drove):
        reasons.append("it stands throughout the second half of every scene")
    return reasons


def try_ego(ego: EgoConfig, scenario: str) -> tuple[EgoTrial, bytes | None]:
    """Plays the middle of a scenario's space, or a safe scene.

    The safe one is the first at random. Returns the scene's picture as a PNG, too.

    Raises:
      ConfigError: the ego is SUMO's driver or cannot be loaded, or there is no such scenario or no safe scene.
    """
    if ego.driver is None:
        got = f"{ego.name!r}, which SUMO drives"
        raise ConfigError("ego", got, "a registered ego", "`risk-sac egos list` names them")
    with closing(RiskSacEnv.of(RunSpec(family=scenario, method=METHOD, seed=0, ego=ego))) as env:
        pilot = env.pilot
        assert pilot is not None  # the ego has a driver
        try:
            scene = _begin(env)
        except EgoFailed as failed:
            return EgoTrial(scenario=scenario, failed=str(failed)), None
        trial = _drive(env, pilot, scenario)
        series = env.trace.series()
        return trial, picture(partial(_drawn, scenario, scene, series), ["png"], DPI, {})[0]


def _begin(env: RiskSacEnv) -> Scene:
    random, space = np.random.default_rng(0), env.problem.space
    point = np.full(space.dimension, 0.5)
    for _ in range(TRIES):
        scene = space.from_unit(point)
        try:
            env.reset(seed=0, options={"scene": scene})
            return scene
        except InfeasibleScene:
            point = random.random(space.dimension)
    raise ConfigError("scenario", f"{env.problem.family.name!r}", f"one with a safe scene among {TRIES}")


def _drive(env: RiskSacEnv, pilot: EgoPilot, scenario: str) -> EgoTrial:
    idle, ratios, clipped, failed, over = np.zeros(env.action_size, np.float32), list[float](), 0, "", False
    info, first = dict[str, Any](), len(env.trace.frames) - 1
    while not over:
        try:
            _, _, terminated, truncated, info = env.step(idle)
        except EgoFailed as error:
            failed = str(error)
            break
        over = terminated or truncated
        ratios.append(pilot.took_s / STEP_S)
        command, car = pilot.commanded, pilot.vehicle
        beyond = max(command.accel_mps2 - car.accel_mps2, -command.accel_mps2 - car.brake_mps2)
        clipped += max(beyond, abs(command.steering_rad) - car.steering_rad) > SLACK
    frames = env.trace.frames[first:]
    speeds = np.array([frame.speed_mps[0] for frame in frames])
    offsets = np.array([frame.state[OFFSET, 0] for frame in frames])
    collision, later = info.get("collision"), ratios[1:] or [0.0]
    return EgoTrial(
        scenario=scenario,
        failed=failed,
        steps=len(ratios),
        driven_m=float(speeds.sum() * STEP_S),
        driven_late_m=float(speeds[len(speeds) // 2 :].sum() * STEP_S),
        stood_s=float(np.count_nonzero(speeds < STANDING_MPS) * STEP_S),
        decision_ratio=float(np.median(later)),
        worst_ratio=max(later),
        late=sum(ratio > 1.0 for ratio in later),
        clipped=clipped,
        farthest_offset_m=float(np.nanmax(np.abs(offsets))),
        contact="" if collision is None else collision.other_id,
        violated=() if failed else tuple(each.requirement for each in env.violations(env.requirement_results())),
    )


def _drawn(scenario: str, scene: Scene, series: Series) -> Figure:
    """Draws ways from above: the ego's with second marks, others grey."""
    x, y = series["x_m"], series["y_m"]
    low = np.array([x[:, 0].min(), y[:, 0].min()]) - MARGIN_M
    high = np.array([x[:, 0].max(), y[:, 0].max()]) + MARGIN_M
    across, up = high - low
    figure = canvas((WIDTH_IN, 1.5 + min((WIDTH_IN - 2.0) * up / across, HIGHEST_IN)))
    axis = figure.subplots()
    for surface in roads_of(scenario, scene.values):
        axis.add_patch(Polygon(surface.outline, facecolor=SURFACE_COLOURS[surface.use], edgecolor="0.7", linewidth=0.5))
    axis.plot(x[:, 1:], y[:, 1:], color="0.5", linewidth=1.0)
    axis.plot([], [], color="0.5", label="others")
    axis.plot(x[:, 0], y[:, 0], color=EGO_COLOUR, linewidth=2.0, label="ego")
    second = round(1.0 / STEP_S)
    axis.plot(x[::second, 0], y[::second, 0], "o", color=EGO_COLOUR, markersize=4, label="each second")
    axis.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal", xlabel="x, m", ylabel="y, m")
    axis.set_title(f"{scenario}, without an attack", fontsize=10)
    legend(axis)
    return figure


LEFT, RIGHT = 1, -1
ASIDE_M, PACE_MPS = 6.0, 1.4  # where the pedestrian comes from, and how fast
AHEAD_S = 6.0  # of driving to where it crosses
WALKED_STEPS = round(ASIDE_M / PACE_MPS / STEP_S)
DRIVING_MPS = 2.0  # a slower ego stops for the pedestrian in any case
MET_STEPS = 120
MET_STANDING_MPS = 0.5
OFFSETS = 41  # of a cycle that are looked at
MET_M = 5.0  # an ego that stays farther from a pedestrian has not met it
ALIKE_M = 1.0  # by which least distances may differ: lane changes and turns bring it nearer to one side


@dataclass(slots=True)
class Tried:
    """Results of the episodes at one place."""

    fit: Fit
    played: int = 0
    rejected: Counter[str] = field(default_factory=Counter)  # by the rule of C_hard that refused the scene
    invalid: list[str] = field(default_factory=list)  # why episodes failed
    touched_unattacked: int = 0  # contacts without an attack
    sides: tuple[float, float] = (math.nan, math.nan)  # least distance of a pedestrian from the left and the right

    @property
    def runs(self) -> bool:
        """Whether no episode was invalid, and some were played."""
        return not self.invalid and self.played > 0

    @property
    def unlike(self) -> str | None:
        """Returns how pedestrians of both sides differ, or None."""
        left, right = self.sides
        if math.isinf(min(left, right)):
            return "the ego stands although nothing is in its way: no pedestrian can meet it"
        if min(left, right) > MET_M:
            within = f"within {MET_STEPS * STEP_S:.0f} s"
            return f"the ego meets no pedestrian {within}: it comes no nearer than {min(left, right):.1f} m"
        touched = [name for name, least_m in zip(("left", "right"), self.sides, strict=True) if least_m == 0.0]
        if touched:
            return f"a pedestrian from the {' and from the '.join(touched)} is touched"
        if abs(left - right) > ALIKE_M:
            return f"a pedestrian from the left is left {left:.1f} m, one from the right {right:.1f} m"
        return None


def sample(fits: Sequence[Fit], count: int, seed: int) -> list[Fit]:
    """Draws up to `count` places of each pattern."""
    draw = np.random.default_rng(seed)
    chosen: list[Fit] = []
    for pattern in dict.fromkeys(fit.spot.pattern for fit in fits):
        own = [fit for fit in fits if fit.spot.pattern == pattern]
        chosen += [own[i] for i in sorted(draw.permutation(len(own))[:count])]
    return chosen


def try_out(fit: Fit, family: str, episodes: int, seed: int) -> Tried:
    """Plays `episodes` scenes at a place, unattacked and with random actions each."""
    tried = Tried(fit)
    problem = Problem.from_spec(RunSpec(family=family, method="random", seed=0))
    for controlled in (False, True):
        with closing(RiskSacEnv(problem, RunSpec.model_fields["learner"].default.reward, controlled=controlled)) as env:
            for index in range(episodes):
                _episode(env, tried, np.random.default_rng((seed, index)), controlled=controlled)
    with closing(SumoSimulation(EgoConfig())) as sim:
        tried.sides = (meet(sim, family, LEFT), meet(sim, family, RIGHT))
    return tried


def _episode(env: RiskSacEnv, tried: Tried, draw: np.random.Generator, *, controlled: bool) -> None:
    scene = env.problem.space.from_unit(draw.random(env.problem.space.dimension))
    simulator_seed, action_seed = (int(value) for value in draw.integers(2**31 - 1, size=2))
    agent, none = RandomAgent(env.action_size, action_seed), np.empty((0, env.action_size))
    try:
        touched = play(env, scene, simulator_seed, none, agent.act).collision is not None
    except InfeasibleScene as infeasible:
        tried.rejected[infeasible.reason] += 1
        return
    except SimulationError as error:
        tried.invalid.append(str(error))
        return
    tried.played += 1
    if not controlled:
        tried.touched_unattacked += touched


def meet(sim: SumoSimulation, family: str, side: int) -> float:
    """Returns a lone ego's least distance to a meeting pedestrian, m.

    The pedestrian crosses where the ego drives on an empty road, and is in the middle of its way at that moment:
    in bends, and where the ego changes lanes, as well as on a straight road. It comes from `side`, LEFT or RIGHT.
    """
    found = family_named(family)
    middle = found.layout(found.space.from_unit(np.full(found.space.dimension, 0.5)).values)
    cycle_s = next((p.high for p in found.space.parameters if p.name == "signal_offset_s"), 0.0)
    alone = _at_green(sim, replace(middle, vehicles=(), pedestrians=()), cycle_s)
    there = _driven_to(sim, alone)
    if there is None:
        return math.inf
    arrives, x, y, heading = there
    x, y = x - side * ASIDE_M * math.sin(heading), y + side * ASIDE_M * math.cos(heading)
    towards = heading - side * math.pi / 2
    start = PedestrianStart(id="walker", role=Role.ADVERSARY, x_m=x, y_m=y, heading_rad=towards, speed_mps=0.0)
    sim.reset(replace(alone, pedestrians=(start,)), 1)
    least_m = math.inf
    for step in range(1, MET_STEPS + 1):
        pace = PACE_MPS if step > arrives - WALKED_STEPS else 0.0
        x, y = x + pace * STEP_S * math.cos(towards), y + pace * STEP_S * math.sin(towards)
        sim.apply({}, {"walker": Walker(x, y, towards, pace)})
        frame = sim.step()
        view = relative_view(frame)
        if frame.ego_speed_mps >= MET_STANDING_MPS:  # a standing ego is walked into in any case
            least_m = min(least_m, 0.0 if view.overlap[0] else float(view.gap[0]))
    return least_m


def _driven_to(sim: SumoSimulation, alone: Layout) -> tuple[int, float, float, float] | None:
    """Returns the ego's first driving step after AHEAD_S, and its pose."""
    sim.reset(alone, 1)
    for step in range(1, MET_STEPS + 1):
        frame = sim.step()
        if step * STEP_S >= AHEAD_S and frame.ego_speed_mps >= DRIVING_MPS:
            return step, float(frame.x_m[0]), float(frame.y_m[0]), float(frame.heading_rad[0])
    return None


def _at_green(sim: SumoSimulation, layout: Layout, cycle_s: float) -> Layout:
    """Returns the layout at the beginning of the ego's green, if any."""
    if layout.signal is None:
        return layout
    before = Signal.GREEN
    for offset_s in np.linspace(0.0, cycle_s, OFFSETS):
        turned = replace(layout, signal_offset_s=float(offset_s))
        now = sim.reset(turned, 1).signal
        if now is Signal.GREEN and before is not Signal.GREEN:
            return turned
        before = now
    return layout
