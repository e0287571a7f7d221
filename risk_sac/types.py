"""The records that flow through the system, all frozen.

Geometry is metric and mathematical: x east, y north, heading 0 = east, counter-clockwise, radians,
and every position is the centre of the actor's body. SUMO's own conventions (front bumper, compass
degrees) end in `risk_sac.sim.sumo`.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import IntEnum, StrEnum

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

STEP_S = 0.1  # one control step is one simulation step


class Kind(IntEnum):
    """What body an actor has."""

    VEHICLE = 0
    PEDESTRIAN = 1


class Role(IntEnum):
    """Who drives an actor."""

    EGO = 0
    ADVERSARY = 1
    BACKGROUND = 2


class Signal(IntEnum):
    """Colour of the signal ahead of the ego; NONE where its road has none."""

    NONE = 0
    GREEN = 1
    YELLOW = 2
    RED = 3


@dataclass(frozen=True, slots=True)
class Scene:
    """Static parameters ξ of one episode: a point in its family's bounded space."""

    family: str
    values: Mapping[str, float]


@dataclass(frozen=True, slots=True)
class Frame:
    """All actors after one simulation step; every array has `n` entries and index 0 is the ego."""

    time_s: float
    ids: tuple[str, ...]
    kind: NDArray[np.int8]
    role: NDArray[np.int8]
    x_m: Floats
    y_m: Floats
    heading_rad: Floats
    vx_mps: Floats  # velocity over the last step, east
    vy_mps: Floats  # north
    speed_mps: Floats  # along the lane or the walking direction, never negative
    lateral_mps: Floats  # across the lane, positive to the left
    accel_mps2: Floats
    length_m: Floats
    width_m: Floats
    signal: Signal
    stop_line_m: float  # ego's front bumper to its next signal's stop line; negative once past; inf without one
    simulator_collisions: tuple[tuple[str, str], ...] = ()  # SUMO's own list, a cross-check only
    teleported: tuple[str, ...] = ()

    @property
    def ego_speed_mps(self) -> float:
        """Speed of the ego."""
        return float(self.speed_mps[0])


class Outcome(StrEnum):
    """How an episode ended; exactly one holds."""

    REJECTED = "rejected"  # C_hard refused the scene; nothing was simulated
    SAFE = "safe"  # the horizon passed without contact
    DEGENERATE = "degenerate"  # raw contact that a validity rule refused
    FAILURE = "failure"  # valid collision


# The rules, among a collision's verdicts, that speak of the simulator or the control and not of who is to blame.
ARTEFACT_RULES = frozenset({"no_teleport", "no_spawn_overlap", "after_first_second", "inside_limits", "solid_bodies"})


@dataclass(frozen=True, slots=True, kw_only=True)
class Collision:
    """The ego's first contact with another actor, with everything later tiers need to judge it."""

    time_s: float
    other_id: str
    other_kind: str  # vehicle | pedestrian
    other_role: str  # adversary | background
    contact_x_m: float  # contact point in the ego's frame; x ahead of the ego's centre
    contact_y_m: float  # positive to the ego's left
    ego_zone: str  # front | left | right | rear: where the contact lies on the ego
    other_zone: str  # the same on the other body
    ego_speed_mps: float
    other_speed_mps: float
    relative_speed_mps: float
    lateral_offset_m: float  # other's centre across the ego's axis at contact
    min_ttc_s: float  # until 1 s before the contact, at which it is 0 for every collision alike
    min_rss_margin_m: float
    visible_for_s: float  # known to the ego without a break before contact, sensor memory included; 0 if unseen
    ego_peak_braking_mps2: float
    min_robustness: float  # soft-min robustness, until 1 s before the contact too
    simulator_agrees: bool  # SUMO's own list names the same pair in the contact's frame; a cross-check only
    verdicts: Mapping[str, bool] = field(default_factory=dict)  # rule -> passed; valid if all passed

    @property
    def valid(self) -> bool:
        """Tier 2: every validity rule passed."""
        return all(self.verdicts.values())

    @property
    def artefact(self) -> bool:
        """Whether the simulator or the control made the contact, by one of `ARTEFACT_RULES`."""
        return any(rule in ARTEFACT_RULES and not passed for rule, passed in self.verdicts.items())


@dataclass(frozen=True, slots=True, kw_only=True)
class EpisodeRecord:
    """One episode as stored, streamed and counted. Plain values only, so it is JSON as it stands."""

    index: int  # 0-based within the run, rejected scenes included
    phase: str  # train | evaluate
    seed: int
    scene: Mapping[str, float]
    outcome: Outcome
    reason: str  # rejection rule or sim_crash, or the failed validity rules joined by ", "; else ""
    steps: int
    risk_return: float  # Σ R_risk
    shaped_return: float  # Σ R'
    mean_cost: float  # mean C_soft over executed steps
    min_ttc_s: float
    min_robustness: float
    objective: float | None  # f_e; None until the optimiser was told
    dual_variable: float  # λ after the episode
    temperature: float  # α after the episode
    environment_steps: int  # of the run, up to and including this episode
    collision: Collision | None = None


@dataclass(frozen=True, slots=True)
class SeriesFile:
    """The time series of an episode, below `failures/` in the run's folder."""

    name: str
    sha256: str  # as it was written, whatever became of it since


@dataclass(frozen=True, slots=True, kw_only=True)
class RunMetrics:
    """What a run has achieved so far; the figures of design section 7 with 95 % intervals."""

    episodes: int  # finished, rejected scenes included
    rejected: int
    raw_collisions: int  # valid and degenerate
    failures: int  # valid
    environment_steps: int
    ecr: float  # valid collisions / episodes
    ecr_low: float
    ecr_high: float
    window_ecr: float  # the same over the newest 100 episodes
    efficiency: float  # ES
    cost_rate: float  # rho_c
    dispersion: float | None  # OFD; None with fewer than two failures
    dual_variable: float  # λ
    temperature: float  # α
    # With defaults, so that what was stored before they were counted can still be read.
    distinct_failures: int = 0  # valid failures that resemble no earlier one, see `risk_sac.metrics`
    steps_per_distinct_failure: float | None = None  # environment steps; None without a failure
