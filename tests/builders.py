"""Frames and records for tests: the test's values, the rest ordinary.

In frames it is at rest, straight ahead and of a car's size. Records tell of an ego that runs into the car before it.
"""

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from risk_sac.records import (
    BehaviourFact,
    Collision,
    ConflictType,
    EpisodeRecord,
    Grade,
    Judgement,
    Outcome,
    Plausibility,
    PlausibilityClass,
    ReferenceOutcome,
    RunMetrics,
    Severity,
    Violation,
)
from risk_sac.scenario.bodies import CODES
from risk_sac.search.prior.attacker import ACTION_SIZE, INPUT_SIZE
from risk_sac.search.prior.policy import PretrainedPolicy
from risk_sac.world.types import Floats, Frame, Kind, Role, Row, Signal

if TYPE_CHECKING:
    from risk_sac.sim.ego import Belief

ROWS = {name: row.index for name, row in vars(Frame).items() if isinstance(row, Row)}
CAR_M, WALKER_M = (4.6, 1.85), (0.5, 0.5)
AVOIDS = ReferenceOutcome(avoids=True, impact_speed_mps=0.0)
LOW_SCENE = {  # the middle of the family
    **dict.fromkeys(("lead_speed_mps", "left_speed_mps", "right_speed_mps"), 11.3),
    **dict.fromkeys(("left_offset_m", "right_offset_m"), 5.0),
    **{"ego_speed_mps": 12.3, "lead_gap_m": 29.0, "follower_gap_m": 25.0, "friction": 0.8},
}
TOUCHES = ReferenceOutcome(avoids=False, impact_speed_mps=6.5)


def frame_of(
    kind: Sequence[Kind] | None = None,
    *,
    time_s: float = 0.0,
    ids: tuple[str, ...] | None = None,
    signal: Signal = Signal.NONE,
    stop_line_m: float = math.inf,
    link: Sequence[int] | None = None,
    **rows: float | Sequence[float] | Floats,
) -> Frame:
    """Makes a frame of `n` actors, the ego first, from state rows.

    Args:
      kind: `n`; vehicles if not given.
      time_s: when.
      ids: `n`; actor_0, actor_1 … if not given.
      signal: ahead of the ego.
      stop_line_m: distance to its line.
      link: `n`, letters of the signals ahead.
      rows: `x_m` and whatever else is known. Speed is that of the velocity, and the velocity that of speed and heading.
    """
    n = len(np.atleast_1d(rows["x_m"]))
    kinds = np.array(kind if kind is not None else [Kind.VEHICLE] * n, dtype=np.int8)
    size = np.where(kinds == Kind.VEHICLE, np.reshape(CAR_M, (2, 1)), np.reshape(WALKER_M, (2, 1)))
    values = {name: np.zeros(n) for name in ROWS} | {"length_m": size[0], "width_m": size[1]}
    values |= {name: np.broadcast_to(np.asarray(row, dtype=np.float64), n) for name, row in rows.items()}
    if "speed_mps" not in rows:
        values["speed_mps"] = np.hypot(values["vx_mps"], values["vy_mps"])
    elif "vx_mps" not in rows and "vy_mps" not in rows:
        values["vx_mps"] = values["speed_mps"] * np.cos(values["heading_rad"])
        values["vy_mps"] = values["speed_mps"] * np.sin(values["heading_rad"])
    return Frame(
        time_s=time_s,
        ids=ids or tuple(f"actor_{i}" for i in range(n)),
        kind=kinds,
        body=np.where(kinds == Kind.VEHICLE, CODES["car"], CODES["pedestrian"]).astype(np.int8),
        role=np.array([Role.EGO] + [Role.ADVERSARY] * (n - 1), dtype=np.int8),
        state=np.array([values[name] for name in ROWS]),
        signal=signal,
        stop_line_m=stop_line_m,
        link=np.zeros(n, dtype=np.uint8) if link is None else np.array(link, dtype=np.uint8),
    )


def moved(frame: Frame, **rows: float | Sequence[float] | Floats) -> Frame:
    """The frame with other values in the rows that are given."""
    state = frame.state.copy()
    for name, row in rows.items():
        state[ROWS[name]] = row
    return frame._replace(state=state)


def belief_of(
    frame: Frame, hidden: Collection[str] = (), expected: Mapping[str, Sequence[float]] | None = None
) -> "Belief":
    """Belief without `hidden` actors, with others expected at x, y, heading, velocity."""
    from risk_sac.sim.ego import MOTION, Belief  # here, because it loads a compiler, which workers of records need not

    state = frame.state.copy()
    for id_, motion in (expected or {}).items():
        state[list(MOTION), frame.ids.index(id_)] = motion
    return Belief(np.array([id_ not in hidden for id_ in frame.ids]), state)


class Told:
    """Senses of an ego, given by a function of frame and number."""

    def __init__(self, tell: "Callable[[Frame, int], Belief]") -> None:
        self.tell = tell
        self._frames = 0

    def reset(self) -> None:
        self._frames = 0

    def look(self, frame: Frame) -> "Belief":
        self._frames += 1
        return self.tell(frame, self._frames - 1)


def judgement(grade: Grade | None = Grade.PREVENTABLE, conflict_s: float = 2.5, **changes: Any) -> Judgement:
    """Judgement of a cut-in on a straight ego; outcomes follow the grade."""
    values: dict[str, Any] = {
        "definitions": 1,
        "conflict_type": ConflictType.CUT_IN,
        "noticed_s": conflict_s,
        "conflict_x_m": 301.0,
        "conflict_y_m": -2.5,
        "position": "ahead",
        "hidden": False,
        "ego_manoeuvre": "straight",
        "ego_response": "late_braking",
        "ground": "lane",
        "broke": ("red_light", "speeding"),
        "ego_broke": (),
        "severity": Severity.MODERATE,
        "impact_mps": 7.0,
        "injury_risk": 0.005,
        "harm": "serious injury",
        "unresponsive": False,
        "drivers": {}
        if grade is None
        else {
            "r157": AVOIDS if grade is Grade.PREVENTABLE else TOUCHES,
            "bound": TOUCHES if grade is Grade.UNAVOIDABLE else AVOIDS,
        },
        "ego_part": None,
        "fault": None,
        "plausibility": None if grade is None else plausibility(),
        "kind": "cut-in, straight",
        "variant": "ahead",
    }
    return Judgement(grade=grade, conflict_s=conflict_s, **(values | changes))


def plausibility(verdict: PlausibilityClass = PlausibilityClass.ORDINARY, **changes: Any) -> Plausibility:
    """Plausibility of one braking by 5.0 m/s²; probabilities do not follow `verdict`."""
    braking = BehaviourFact(
        actor="lead", feature="braking", value=5.0, time_s=2.0, times=1, probability=0.04, published=True
    )
    values: dict[str, Any] = {
        "least_probability": 0.2,
        "joint_probability": 0.3,
        "facts": (braking,),
        "sentence": "lead brakes by 5.0 m/s²: 1 of 25 stops",
    }
    return Plausibility(verdict=verdict, **(values | changes))


def collision(**changes: Any) -> Collision:
    """The ego's front hits the car ahead; ungraded, refused by no rule."""
    values: dict[str, Any] = {
        "time_s": 3.2,
        "other_id": "lead",
        "other_kind": "vehicle",
        "other_body": "car",
        "other_role": "adversary",
        "contact_x_m": 2.3,
        "contact_y_m": 0.1,
        "ego_zone": "front",
        "other_zone": "rear",
        "ego_speed_mps": 9.0,
        "other_speed_mps": 2.0,
        "relative_speed_mps": 7.0,
        "lateral_offset_m": 0.1,
        "early_min_ttc_s": 0.3,
        "min_rss_margin_m": -3.0,
        "visible_for_s": 3.0,
        "ego_peak_braking_mps2": 4.5,
        "early_min_robustness": -1.0,
        "simulator_agrees": True,
        "verdicts": {"inside_limits": True, "ego_moving": True},
        "judgement": judgement(None),
    }
    return Collision(**(values | changes))


def violation(**changes: Any) -> Violation:
    """Violation of `never_fast` 1.5 s after the release, refused by no rule."""
    values: dict[str, Any] = {
        "requirement": "never_fast",
        "time_s": 1.5,
        "robustness": -0.4,
        "other_id": None,
        "other_kind": None,
        "other_body": None,
        "other_role": None,
        "ego_speed_mps": 9.0,
        "ego_manoeuvre": "straight",
        "hidden": False,
        "broke": (),
        "verdicts": {"no_teleport": True, "inside_limits": True},
        "grade": None,
        "drivers": {},
        "fault": None,
        "plausibility": None if changes.get("grade") is None else plausibility(),
        "kind": "never_fast violated; straight",
        "variant": "ego fast",
        "definitions": 1,
    }
    return Violation(**(values | changes))


def episode_record(index: int = 0, outcome: Outcome = Outcome.SAFE, **changes: Any) -> EpisodeRecord:
    """Episode of the search; earlier ones were equally long, refused ones empty."""
    steps = changes.get("steps", 0 if outcome is Outcome.REJECTED else 100)
    values: dict[str, Any] = {
        "phase": "search",
        "seed": index,
        "scene": {"lead_gap_m": 12.5},
        "reason": "",
        "steps": steps,
        "risk_return": 1.0,
        "shaped_return": 0.5,
        "mean_cost": 0.1,
        "min_ttc_s": 0.3,
        "min_robustness": -1.0,
        "objective": None,
        "dual_variable": 0.3,
        "temperature": 0.2,
        "environment_steps": steps * (index + 1),
    }
    return EpisodeRecord(index=index, outcome=outcome, **(values | changes))


def run_metrics(episodes: int = 4, **changes: Any) -> RunMetrics:
    """Of so many episodes of 100 steps without a contact."""
    values: dict[str, Any] = {
        "rejected": 0,
        "raw_collisions": 0,
        "failures": 0,
        "environment_steps": 100 * episodes,
        "ecr": 0.0,
        "ecr_low": 0.0,
        "ecr_high": 0.5,
        "window_ecr": 0.0,
        "efficiency": 0.0,
        "cost_rate": 0.0,
        "dispersion": None,
        "dual_variable": 0.0,
        "temperature": 0.0,
    }
    return RunMetrics(episodes=episodes, **(values | changes))


def pretrained_policy() -> PretrainedPolicy:
    """A small pretrained policy of random weights that survive half precision."""
    random, hidden = np.random.default_rng(3), 8

    def layers(count: int, *sizes: int) -> tuple[NDArray[np.float32], ...]:
        shapes = [shape for rows, out in pairwise(sizes) for shape in ((count, rows, out), (count, 1, out))]
        return tuple(random.integers(-8, 9, shape).astype(np.float32) / 16 for shape in shapes)

    policy = layers(1, INPUT_SIZE, hidden, hidden, 2 * ACTION_SIZE)
    critics = layers(2, INPUT_SIZE + ACTION_SIZE, hidden, hidden, 1)
    return PretrainedPolicy(policy, critics, 0.03, {"episodes": 12})
