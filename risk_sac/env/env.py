"""Gymnasium environment: adversaries act, SUMO and its ego answer in closed loop.

Importing this module registers RiskSAC/Low-v0, RiskSAC/MotorwayCutIn-v0 and so on for each shipped scenario, and
`gymnasium.make("risk_sac.env.env:RiskSAC/Low-v0", ego="careful")` imports it first; see `risk_sac.gym_env`.
The reward is R_risk alone; the realism cost and the robustness come in `info`, because λ and the
shaping belong to the learner.
A process plays in one environment at a time: for several, use `gymnasium.vector.AsyncVectorEnv`.

Source: RISK-SAC, Alg. 1, l. 5 and 8.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from risk_sac.config import FamilyName, RewardConfig, RunSpec, method_of
from risk_sac.egos.defects.catalogue import settings_of
from risk_sac.egos.pilot import EgoPilot
from risk_sac.egos.registry import load
from risk_sac.env.observation import Encoder
from risk_sac.env.observation_layout import LIMIT
from risk_sac.env.problem import Problem
from risk_sac.errors import InfeasibleScene, SimulationError
from risk_sac.host.process_state import c_numbers
from risk_sac.maps.carriageway import carriageway_of
from risk_sac.records import Collision, RequirementResult, StoryDeviation, Violation
from risk_sac.risk.conduct import CONDUCT_ROWS, ConductRoad, conduct_cost, see_signals
from risk_sac.risk.measures import Gauge, Measures
from risk_sac.risk.reward import HardRule, ViolationDepth, danger_of, refuse_danger, refuse_overlap, risk_reward, worth
from risk_sac.run_folder.series import Trace
from risk_sac.scenario.layout import LEAD_IN_S, Layout
from risk_sac.scenario.limits import conditions, limits_from_odd
from risk_sac.scenario.reading import shipped_names
from risk_sac.sim.collision import Contact, find_contact
from risk_sac.sim.control import Adversaries, RecordedAdversaries, shares_of
from risk_sac.sim.ego import EVERYTHING, Perception, sight
from risk_sac.sim.sumo import SumoSimulation
from risk_sac.verdicts.competent import avoided_by
from risk_sac.verdicts.course import Path, polyline
from risk_sac.verdicts.evidence import Evidence, Ground
from risk_sac.verdicts.judge import collision_of, requirement_results, violations_of
from risk_sac.verdicts.online import conflicts_now, reflex_of
from risk_sac.verdicts.reference import History
from risk_sac.verdicts.validity import EpisodeFacts
from risk_sac.world.geometry import relative_view
from risk_sac.world.types import STEP_S, Bools, Floats, Frame, Kind, Scene

FEASIBLE_TRIES = 100
Observation = NDArray[np.float32]


class RiskSacEnv(gym.Env[Observation, Observation]):
    """One problem; `reset` takes a scene, or draws feasible ones by itself."""

    metadata = {"render_modes": []}  # noqa: RUF012  # Gymnasium's own declaration

    def __init__(
        self,
        problem: Problem,
        reward: RewardConfig,
        *,
        controlled: bool = True,
        as_written: bool = False,
        ego_server: int = 0,
    ) -> None:
        """Prepares, but starts no simulation.

        Args:
          problem: what to falsify.
          reward: the terms of R_risk, and β of the soft minimum.
          controlled: False leaves the adversary vehicles to SUMO and lets pedestrians stand: a control.
          as_written: whether nothing deviates from the scenario, so that the others' behaviour is not judged.
          ego_server: which of a remote ego's servers drives, see `load`.

        Raises:
          ConfigError: the problem's ego is not registered, in another version, or cannot be loaded.
        """
        self.problem = problem
        self._reward = reward
        self._controlled, self._as_written = controlled, as_written
        sensor, horizon_steps = problem.ego.sensor, problem.family.horizon_steps
        self._perception = Perception(sensor.memory_s if sensor else 0.0, EVERYTHING)
        ego = load(problem.ego, ego_server)
        self.pilot = None if ego is None else EgoPilot(ego, problem.ego)
        self._sim = SumoSimulation(problem.ego, self._perception, self.pilot, settings_of(problem.ego))
        self._gauge = Gauge(problem.requirements, horizon_steps, problem.rss, reward.softmin_sharpness)
        self._violated = ViolationDepth(problem.requirements)
        self._encoder = Encoder(problem.family, problem.space.dimension, len(problem.requirements))
        self.observation_size = self._encoder.size
        self.action_size = problem.action_size
        self.action_space = gym.spaces.Box(-1.0, 1.0, (self.action_size,), np.float32)
        self.observation_space = gym.spaces.Box(-LIMIT, LIMIT, (self.observation_size,), np.float32)

    @classmethod
    def of(cls, spec: RunSpec, ego_server: int = 0) -> "RiskSacEnv":
        """The environment that the episodes of a run are played in.

        Args:
          spec: the run.
          ego_server: which of a remote ego's servers drives, see `load`.

        Raises:
          ConfigError: the spec poses no problem that can be run.
        """
        method = method_of(spec.method)
        return cls(
            Problem.from_spec(spec),
            spec.learner.reward,
            controlled=method.agent != "none",
            as_written=method.story,
            ego_server=ego_server,
        )

    # The state of an episode, set by `_start`.
    layout: Layout  # of the episode's start
    trace: Trace  # all that is recorded of it
    start_danger: HardRule | None  # rule for safe starts that the start breaks
    _adversaries: Adversaries
    _frame: Frame
    _measures: Measures
    _road: ConductRoad
    _conduct: Floats  # what C_soft remembers, CONDUCT_ROWS x adversaries
    _steps: int
    _contact_s: float | None  # from the release
    _artefacts: dict[str, float]  # rule that the episode broke -> when it first did
    _way: Path  # the ego's way ahead at the release

    @c_numbers
    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Starts an episode.

        Args:
          seed: reseeds the generator that SUMO's seed, and a scene where none is given, are drawn from.
          options: `{"scene": Scene}` to start from that scene; with `"motions"`, an episode's time series, its
            adversaries repeat these.

        Raises:
          InfeasibleScene: the given scene breaks a rule of C_hard.
          SceneError: it is no point of the problem's space.
          SimulationError: no feasible scene was found, or SUMO failed.
          EgoFailed: the ego cannot drive.
        """
        super().reset(seed=seed)
        if options and "scene" in options:
            return self._start(options["scene"], options.get("motions"))
        for _ in range(FEASIBLE_TRIES):
            try:
                return self._start(self.problem.space.from_unit(self.np_random.random(self.problem.space.dimension)))
            except InfeasibleScene:
                continue
        raise SimulationError(f"none of {FEASIBLE_TRIES} random scenes of {self.problem.family.name!r} is feasible")

    @c_numbers
    def step(self, action: Observation) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """One control step of 0.1 s.

        Args:
          action: two entries in [-1, 1] per adversary, see `risk_sac.sim.control`; what is beyond is clipped.

        Returns:
          Observation, R_risk, whether the ego touched something, whether it reached the horizon or its route's end, and
          `info` with `cost` (C_soft), `robustness` (soft minimum) and, at a contact, `collision`.

        Raises:
          ValueError: the action has another shape, or entries that are no finite numbers.
          SimulationError: SUMO failed, or the environment was not reset.
          EgoFailed: the ego cannot drive on; the episode is invalid.
        """
        if not self._sim.running:
            raise SimulationError("the environment has no episode to step; call reset first")
        shares = shares_of(action, self.action_size)
        if self._controlled:
            self._adversaries.command(shares, self._frame, self._sim)
        if self._reflex is not None:
            self._sim.brake(self._reflex.braking(self._frame, self._ego_path(), self._in_sight()))
        before, self._frame = self._frame, self._sim.step()
        contact = find_contact(before, self._frame)
        self._measures = self._measure(before, 0 if contact is None else contact.other)
        self._steps += 1
        if self._controlled and not self._adversaries.keep_limits(self._frame):
            self._artefacts.setdefault("inside_limits", self._frame.time_s)
        if self._frame.teleported:
            self._artefacts.setdefault("no_teleport", self._frame.time_s)
        self.trace.append(self._frame, self._measures, shares)
        collision = None if contact is None else self._judge(contact)
        self._contact_s = None if collision is None else collision.time_s
        cost = self._cost()
        reward = risk_reward(
            self._measures.signals["ttc_s"],
            self._measures.signals["rss_margin"],
            0.0 if collision is None else worth(collision, self._reward),
            float(collision is not None and not collision.valid),
            self._violated.gained(self._measures.robustness),
            self._reward,
        )
        over = self._sim.ego_arrived or self._sim.story_over
        truncated = over or self._steps >= self.layout.horizon_steps
        info: dict[str, Any] = {"cost": cost, "robustness": self._measures.soft_min}
        if collision is not None:
            info["collision"] = collision
        return self._observe(), reward, collision is not None, truncated, info

    @property
    def defect_reached_s(self) -> float | None:
        """Time from release to a defect's first changed command, s, or None."""
        return self.pilot.defect_reached_s if self.pilot and self.problem.ego.defects else None

    def signal_heads(self) -> bytes:
        """SUMO's letter of each link, signal by signal, in order of name."""
        return self._sim.signal_heads()

    @c_numbers
    def close(self) -> None:
        """Ends the simulation, and lets the ego go."""
        self._sim.close()
        if self.pilot is not None:
            self.pilot.close()

    def _start(
        self, scene: Scene, motions: Mapping[str, NDArray[Any]] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        self._unit_scene = self.problem.space.to_unit(scene)
        self.trace, self.start_danger = Trace(self._gauge.names), None  # of this scene, even where it has no layout
        layout = self.layout = self.problem.family.layout(scene.values)
        limits = limits_from_odd(self.problem.odd, layout.friction)
        self._ground = Ground.of(layout, self.problem.speed_limit_mps)
        carriageway = carriageway_of(layout.net)
        self._road = ConductRoad(layout, self.problem.speed_limit_mps, carriageway)
        sumo_seed = int(self.np_random.integers(2**31 - 1))
        self._reflex = reflex_of(self.problem.ego.profile, self._ground)
        self._gauge.reset(carriageway)
        sensor = self.problem.ego.sensor
        visible = conditions(self.problem.odd, scene.values, sensor=sensor is not None)
        self._perception.sight = sight(sensor, visible.visibility_m, visible.unlit_m)
        self._steps = 0
        self._artefacts = {}
        self._conduct = np.zeros((CONDUCT_ROWS, len(self.problem.family.adversaries)))
        self._contact_s = None
        self._lead_in(self._sim.reset(layout, sumo_seed), scene, 0.0 if layout.story else LEAD_IN_S)
        self._released_s = self._frame.time_s
        started = self.problem.family, limits, self._frame, layout.story
        self._adversaries = Adversaries(*started) if motions is None else RecordedAdversaries(*started, motions)
        for frame in self.trace.frames:
            rows = self._adversaries.rows(frame)
            see_signals(rows, self._adversaries.slots, frame.link, self._conduct)
        danger = danger_of(self._measures.assessment, in_conflict=self._r157_driver_in_conflict())
        if layout.story is None:
            refuse_danger(danger, scene)
        self.start_danger = danger  # of a story, which is not refused for it
        self._violated.begin(self._measures.robustness)
        self._way = self._ego_path()
        self._sim.hand_over_ego()
        if self._controlled:
            self._sim.release()
        else:
            self._sim.halt_walkers()
        return self._observe(), {"robustness": self._measures.soft_min}

    def _lead_in(self, start: Frame, scene: Scene, lead_in_s: float) -> None:
        """Plays the traffic before the release, in which SUMO drives all vehicles."""
        self._frame = start
        self._measures = self._measure(None)
        self.trace.append(start, self._measures, None)
        refuse_overlap(self._frame, scene)
        for _ in range(round(lead_in_s / STEP_S)):
            self._sim.walk_on()
            before, self._frame = self._frame, self._sim.step()
            self._measures = self._measure(before)
            self.trace.append(self._frame, self._measures, None)
            refuse_overlap(self._frame, scene)

    def _measure(self, before: Frame | None, struck: int = 0) -> Measures:
        return self._gauge.measure(self._frame, before, self._perception.seen, struck)

    def _r157_driver_in_conflict(self) -> bool:
        # Wary: the policy is not handed a vehicle that hangs over beside the ego already.
        return bool(conflicts_now(self._frame, self._ego_path(), self._in_sight(), self._ground, wary=True).any())

    def _ego_path(self) -> Path:
        return polyline(*self._sim.ego_path(), float(self._frame.heading_rad[0]))

    def _in_sight(self) -> Bools:
        return np.concatenate(([True], self._measures.assessment.seen))

    def _cost(self) -> float:
        """Computes C_soft of Eq. 5 over the adversaries; updates their memory."""
        frame, adversaries = self._frame, self._adversaries
        rows = adversaries.rows(frame)
        near = self._road.near(rows, frame.state)
        return conduct_cost(rows, adversaries.slots, frame.kind, frame.link, frame.state, self._conduct, *near)

    def _judge(self, contact: Contact) -> Collision:
        frame = self._frame
        other = frame.ids[contact.other]
        # SUMO tests bodies at the end of a step only; of a pedestrian, the ego's model knows the oracle's own box.
        comparable = frame.kind[contact.other] == Kind.VEHICLE and relative_view(frame).overlap[contact.other - 1]
        facts = EpisodeFacts(
            teleported="no_teleport" in self._artefacts,
            inside_limits="inside_limits" not in self._artefacts,
            simulator_agrees=self._sim.lists_collision(other) if comparable else None,
            visible_for_s=self._perception.in_view_for(other, frame.time_s),
            ever_visible=self._perception.ever_seen(other),
        )
        measures, drivers = self.trace.since_release, self.problem.drivers
        return collision_of(contact, frame, self._released_s, self.evidence(), measures, facts, drivers=drivers)

    def requirement_results(self) -> dict[str, RequirementResult]:
        """Returns the robustness of each requirement since the release."""
        time_s = [round(frame.time_s - self._released_s, 6) for frame in self.trace.frames[self.trace.released :]]
        return requirement_results(self.problem.requirements, time_s, self.trace.since_release, self._contact_s)

    def violations(self, results: Mapping[str, RequirementResult]) -> tuple[Violation, ...]:
        """Violations without contact of the requirements that count; see `violations_of`."""
        requirements, drivers = self.problem.requirements, self.problem.drivers
        return violations_of(requirements, results, self._history, self._gauge, self._artefacts, drivers=drivers)

    def _history(self) -> History:
        return History(self.trace.frames, self.trace.measures, self.evidence())

    def evidence(self) -> Evidence:
        """Returns the evidence of the episode so far, for the judge."""
        evidence = Evidence.from_series(self.trace.series(), self._ground, self._released_s)
        return replace(evidence, as_written=self._as_written)

    @property
    def deviations(self) -> Mapping[str, StoryDeviation]:
        """Largest deviation of each actor that left the scenario's story."""
        return {
            name: StoryDeviation(
                speed_mps=drift.mps,
                lateral_mps=drift.lateral_mps,
                along_m=drift.ahead_m,
                across_m=drift.left_m,
                trigger_s=drift.trigger_s,
            )
            for name, drift in self._sim.deviations.items()
        }

    def avoided_by(self) -> Mapping[str, bool] | None:
        """Asks competent drivers whether they avoid a contact, whatever the ego did.

        None where others deviate from the scenario.

        See `risk_sac.verdicts.competent`.
        """
        return avoided_by(self.evidence(), self._way) if self._as_written else None

    def _observe(self) -> Observation:
        time_left = 1.0 - self._steps / self.layout.horizon_steps
        m = self._measures
        return self._encoder.encode(self._frame, m.assessment, self._conduct, m.robustness, self._unit_scene, time_left)


def make_default(family: FamilyName) -> RiskSacEnv:
    """Returns the environment of a family's default problem."""
    return RiskSacEnv.of(RunSpec(family=family, method="risk-sac", seed=0))


for _family in shipped_names():  # names alone: reading all documents takes a second
    gym.register(
        f"RiskSAC/{''.join(map(str.capitalize, _family.split('_')))}-v0",
        entry_point="risk_sac.gym_env:NamedEnv",
        kwargs={"family": _family},
    )
