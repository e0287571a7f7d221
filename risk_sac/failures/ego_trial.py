"""Plays scenes without an attack with a registered ego, and tells whether it is fit for a search."""

from collections.abc import Sequence
from contextlib import closing
from functools import partial
from typing import Any, Literal

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from risk_sac.config import EgoConfig, RunSpec
from risk_sac.egos.pilot import EgoPilot
from risk_sac.env.env import RiskSacEnv
from risk_sac.errors import ConfigError, EgoFailed, InfeasibleScene
from risk_sac.failures.from_above import EGO_COLOUR, SURFACE_COLOURS, canvas, legend, picture
from risk_sac.failures.net import roads_of
from risk_sac.failures.recording import Series
from risk_sac.records import Record
from risk_sac.world.types import OFFSET, STEP_S, Scene

TRIES = 100  # scenes that are drawn where the middle of the space is unsafe
STANDING_MPS = 0.3
LEAST_M = 1.0  # an ego that drives less in the second half of all scenes does not move
MARGIN_M = 15.0
WIDTH_IN, HIGHEST_IN, DPI = 10.0, 8.0, 110
SLACK = 1e-6
METHOD: Literal["no-adversary"] = "no-adversary"


class EgoTrial(Record):
    """How an ego drove one scene in which nothing attacks."""

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
    """Returns why a search against an ego would tell nothing; empty if it is fit."""
    reasons = [f"{trial.scenario}: {trial.failed}" for trial in trials if trial.failed]
    reasons += [f"{trial.scenario}: it touches {trial.contact} without an attack" for trial in trials if trial.contact]
    drove = [trial for trial in trials if not trial.failed]
    if drove and all(trial.driven_late_m < LEAST_M for trial in drove):
        reasons.append("it stands throughout the second half of every scene")
    return reasons


def try_ego(ego: EgoConfig, scenario: str) -> tuple[EgoTrial, bytes | None]:
    """Plays the middle of a scenario's space, or the first safe scene at random; returns its picture as a PNG too.

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
    """Draws the ways from above: the ego's with a dot each second, those of others in grey."""
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
