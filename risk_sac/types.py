"""The records that flow through the system, all frozen.

Geometry is metric and mathematical: x east, y north, heading 0 = east, counter-clockwise, radians,
and every position is the centre of the actor's body. SUMO's own conventions (front bumper, compass
degrees) end in `risk_sac.sim.reading`.
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


# Rows of a frame's state. Compiled code takes the whole of it: each array that it is handed costs as much as a loop.
X, Y, HEADING, VX, VY, SPEED, LATERAL, ACCEL, OFFSET, LENGTH, WIDTH = range(11)


class Row:
    """One row of a frame's state, read by name."""

    def __init__(self, index: int) -> None:
        self.index = index

    def __get__(self, frame: "Frame", owner: type) -> Floats:
        """The row, `n`; a view."""
        row: Floats = frame.state[self.index]
        return row


@dataclass(frozen=True, slots=True)
class Frame:
    """All actors after one simulation step; every array has `n` columns and the first is the ego's."""

    time_s: float
    ids: tuple[str, ...]
    kind: NDArray[np.int8]
    role: NDArray[np.int8]
    state: Floats  # rows x n: those below
    signal: Signal
    stop_line_m: float  # ego's front bumper to its next signal's stop line; negative once past; inf without one
    link: NDArray[np.uint8]  # SUMO's letter of the signal ahead, such as ord("g"): green, but has to yield; 0: none
    simulator_collisions: tuple[tuple[str, str], ...] = ()  # SUMO's own list, a cross-check only
    teleported: tuple[str, ...] = ()

    x_m = Row(X)
    y_m = Row(Y)
    heading_rad = Row(HEADING)
    vx_mps = Row(VX)  # velocity over the last step, east
    vy_mps = Row(VY)  # north
    speed_mps = Row(SPEED)  # along the lane or the walking direction, never negative
    lateral_mps = Row(LATERAL)  # across the lane, positive to the left
    accel_mps2 = Row(ACCEL)
    lane_offset_m = Row(OFFSET)  # a vehicle's centre from its lane's centre, positive to the left; 0 of pedestrians
    length_m = Row(LENGTH)
    width_m = Row(WIDTH)

    @property
    def ego_speed_mps(self) -> float:
        """Speed of the ego."""
        return float(self.state[SPEED, 0])


class Outcome(StrEnum):
    """How an episode ended; exactly one holds."""

    REJECTED = "rejected"  # C_hard refused the scene; nothing was simulated
    SAFE = "safe"  # the horizon passed without contact
    DEGENERATE = "degenerate"  # raw contact that a validity rule refused
    FAILURE = "failure"  # valid collision


# The rules, among a collision's verdicts, that speak of the simulator or the control and not of who is to blame.
ARTEFACT_RULES = frozenset(
    {
        "no_teleport",
        "no_spawn_overlap",
        "conflict_after_release",
        "inside_limits",
        "inside_grip",
        "solid_bodies",
        "ego_model_saw",
    }
)


class ConflictType(StrEnum):
    """How the striker came into the ego's way."""

    CUT_IN = "cut_in"
    LEADER = "leader"
    PEDESTRIAN = "pedestrian"
    CROSSING = "crossing_vehicle"


class Grade(StrEnum):
    """Who would have prevented a valid failure; PCR counts `CAREFUL`."""

    CAREFUL = "careful"  # the careful driver would not have touched: preventable
    IDEAL = "ideal"  # full braking at once alone would not have
    UNAVOIDABLE = "unavoidable"


@dataclass(frozen=True, slots=True, kw_only=True)
class ReferenceOutcome:
    """How a reference driver fares in the ego's place."""

    avoids: bool  # does not touch, or stands when it is struck, or is struck from behind
    impact_speed_mps: float  # of the reference driver at its contact; 0 if it avoids


@dataclass(frozen=True, slots=True, kw_only=True)
class Judgement:
    """How a contact came about, and who would have prevented it. Times count from the adversaries' release."""

    definitions: int  # version of the definitions it was judged by
    conflict_type: ConflictType
    conflict_s: float  # t0, when the conflict began; negative before the release
    conflict_x_m: float  # where the striker was then, on the map
    conflict_y_m: float
    position: str  # ahead | alongside: the striker, seen from the ego, when the conflict began
    hidden: bool  # whether the ego knew nothing of the striker when the conflict began
    ego_manoeuvre: str  # straight | left_turn | right_turn | lane_change
    ego_response: str  # none | late_braking | braking | standing | starting
    ground: str  # lane | junction | crossing | beside_crossing: where the striker was struck
    broke: tuple[str, ...]  # what the striker broke: red_light, priority, wrong_direction, speeding, pedestrian_on_red
    unresponsive: bool  # a visible collision course of 1.5 s or more during which the ego never braked
    grade: Grade | None  # None where the contact is not valid
    drivers: Mapping[str, ReferenceOutcome]  # reference driver -> how it fares; empty where the contact is not valid
    signature: str  # the class of failures it belongs to, in words; what differs in it is distinct


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
    simulator_agrees: bool | None  # SUMO lists the same pair within 0.3 s; None for pedestrians, whom it does not know
    verdicts: Mapping[str, bool] = field(default_factory=dict)  # rule -> passed; valid if all passed
    judgement: Judgement | None = None  # None in what was stored before contacts were judged

    @property
    def valid(self) -> bool:
        """Tier 2: every validity rule passed."""
        return all(self.verdicts.values())

    @property
    def artefact(self) -> bool:
        """Whether the simulator or the control made the contact, by one of `ARTEFACT_RULES`."""
        return any(rule in ARTEFACT_RULES and not passed for rule, passed in self.verdicts.items())

    @property
    def preventable(self) -> bool:
        """Whether it is valid and the careful driver would have prevented it."""
        return self.valid and self.judgement is not None and self.judgement.grade is Grade.CAREFUL


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
    distinct_failures: int = 0  # valid failures that resemble no earlier one, see `risk_sac.verdicts.distinct`
    steps_per_distinct_failure: float | None = None  # environment steps; None without a failure
    preventable: int = 0  # valid and of grade `careful`
    pcr: float = 0.0  # preventable / episodes
    pcr_low: float = 0.0
    pcr_high: float = 1.0
    window_pcr: float = 0.0
    distinct_preventable: int = 0  # distinct failures of grade `careful`
    artefacts: int = 0  # contacts that the simulator or the control made
    unresponsive: int = 0  # valid failures in which the ego never braked for what it saw
    signatures: Mapping[str, int] = field(default_factory=dict)  # signature -> valid failures
    conflicts_by_second: tuple[int, ...] = ()  # valid failures by the second after the release in which they began
    contacts_by_second: tuple[int, ...] = ()  # the same by the second of the contact
