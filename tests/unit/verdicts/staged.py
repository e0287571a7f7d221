"""Episodes staged by motions over time, up to the first contact."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from risk_sac.records import Judgement
from risk_sac.scenario.bodies import CODES
from risk_sac.scenario.layout import Area
from risk_sac.verdicts.evidence import Evidence, Ground
from risk_sac.verdicts.judge import judge
from risk_sac.verdicts.validity import EpisodeFacts
from risk_sac.world.geometry import Size, touches
from risk_sac.world.types import STEP_S, Floats, Kind, Role

CAR_M = (4.6, 1.85)
PERSON_M = (0.5, 0.5)
WALKING = (Kind.VEHICLE, Kind.PEDESTRIAN)
LANE_M = 3.3
STREET = Ground(
    friction=1.0,
    speed_limit_mps=13.89,
    lane_width_m=LANE_M,
    crossings=(Area.box(98.0, 102.0, -6.6, 6.6),),
    roadway=(Area.box(-1000.0, 1000.0, -6.6, 6.6),),
)
CLEAN = EpisodeFacts(teleported=False, inside_limits=True, simulator_agrees=True, visible_for_s=3.0, ever_visible=True)
Motion = Callable[[float], tuple[float, float, float]]  # time from the release -> x, y, heading


def straight(
    x: float, y: float, heading: float, speed: float, *changes: tuple[float, float], start_s: float = -1.5
) -> Motion:
    """Line from (x, y) at `start_s`; changes: (from when, acceleration)."""
    pieces = [(start_s, 0.0, speed, 0.0)]  # from when, metres gone, speed, acceleration
    for since, accel in changes:
        pieces.append((since, *_gone(pieces[-1], since), accel))

    def at(t: float) -> tuple[float, float, float]:
        s, _ = _gone(next(piece for piece in reversed(pieces) if t >= piece[0] or piece is pieces[0]), t)
        return x + s * math.cos(heading), y + s * math.sin(heading), heading

    return at


def _gone(piece: tuple[float, float, float, float], t: float) -> tuple[float, float]:
    """Metres gone and speed at `t`; braking ends at a stand."""
    since, gone, speed, accel = piece
    after = t - since
    if accel < 0.0:
        after = min(after, speed / -accel)
    return gone + speed * after + accel * after * after / 2, speed + accel * after


def sideways(motion: Motion, start_s: float, rate_mps: float, until_m: float) -> Motion:
    """Adds a lateral move from `start_s`, left positive, by at most `until_m`."""

    def at(t: float) -> tuple[float, float, float]:
        x, y, heading = motion(t)
        moved = math.copysign(min(abs(rate_mps) * max(t - start_s, 0.0), abs(until_m)), rate_mps)
        return x - moved * math.sin(heading), y + moved * math.cos(heading), heading

    return at


def waiting(x: float, y: float, heading: float, speed: float, until_s: float) -> Motion:
    """Stands until `until_s` and then goes straight."""
    go = straight(x, y, heading, speed, start_s=until_s)
    return lambda t: go(max(t, until_s))


def stage(
    *motions: Motion,
    kinds: Sequence[Kind] = (Kind.VEHICLE, Kind.VEHICLE),
    ground: Ground = STREET,
    seen_from_s: float = -math.inf,
    from_s: float = -1.5,
    until_s: float = 12.0,
    offsets: bool = True,
    contact: bool = True,
) -> Evidence:
    """Records an episode of motions, the ego's first, until contact or end."""
    times = np.arange(round(from_s / STEP_S), round(until_s / STEP_S) + 1) * STEP_S
    poses = np.array([[motion(t) for motion in motions] for t in times])  # T x n x 3
    before = np.array([[motion(t - STEP_S) for motion in motions] for t in times])
    sizes = np.array([CAR_M if kind is Kind.VEHICLE else PERSON_M for kind in kinds])
    last = _first_contact(poses, sizes) if contact else len(times) - 1
    poses, before, times = poses[: last + 1], before[: last + 1], times[: last + 1]
    x, y, heading = np.moveaxis(poses, 2, 0)
    vx, vy = ((poses - before)[..., :2] / STEP_S).transpose(2, 0, 1)
    speed = np.abs(vx * np.cos(heading) + vy * np.sin(heading))
    n = len(motions)
    offset = (y + LANE_M / 2) % LANE_M - LANE_M / 2 if offsets else np.full_like(y, np.nan)
    offset = np.where(np.cos(heading) < 0.0, -offset, offset)
    return Evidence(
        time_s=times,
        ids=tuple(f"actor_{i}" for i in range(n)),
        kind=np.array(kinds, dtype=np.int8),
        body=np.array([CODES["car" if kind is Kind.VEHICLE else "pedestrian"] for kind in kinds], dtype=np.int8),
        role=np.array([Role.EGO] + [Role.ADVERSARY] * (n - 1), dtype=np.int8),
        length_m=sizes[:, 0].copy(),
        width_m=sizes[:, 1].copy(),
        x_m=x.copy(),
        y_m=y.copy(),
        heading_rad=heading.copy(),
        vx_mps=vx.copy(),
        vy_mps=vy.copy(),
        speed_mps=speed,
        lateral_mps=vy * np.cos(heading) - vx * np.sin(heading),
        accel_mps2=np.diff(speed, axis=0, prepend=speed[:1]) / STEP_S,
        lane_offset_m=offset,
        link=np.zeros((len(times), n)),  # as `Trace.series` has it, which needs NaN
        known=np.repeat((times >= seen_from_s - 1e-9)[:, None], n, axis=1) | (np.arange(n) == 0),
        ground=ground,
    )


def _first_contact(poses: Floats, sizes: Floats) -> int:
    for t, frame in enumerate(poses):
        for i in range(1, len(sizes)):
            if touches(tuple(frame[0]), Size(*sizes[0] / 2), tuple(frame[i]), Size(*sizes[i] / 2)):
                return t
    raise AssertionError("nobody touched the ego; the staged episode has no contact")


def mirrored(evidence: Evidence) -> Evidence:
    """Mirrors the evidence along the x axis: left becomes right."""
    areas = {
        name: tuple(Area(tuple((nx, -ny, c) for nx, ny, c in a.sides)) for a in getattr(evidence.ground, name))
        for name in ("crossings", "junctions", "roadway")
    }
    return replace(
        evidence,
        y_m=-evidence.y_m,
        heading_rad=-evidence.heading_rad,
        vy_mps=-evidence.vy_mps,
        lateral_mps=-evidence.lateral_mps,
        lane_offset_m=-evidence.lane_offset_m,
        ground=replace(evidence.ground, **areas),
    )


def judged(evidence: Evidence) -> Judgement:
    """Judges a contact with `actor_1`; its mirror image must agree."""
    first, second = (judge(each, "actor_1", valid=True) for each in (evidence, mirrored(evidence)))
    sides = {"conflict_y_m": first.conflict_y_m, "kind": first.kind}
    assert second.model_copy(update=sides) == first
    return first


# The recurring cast: the ego in the lane along y = 0, whose left neighbour is y = 3.3.
def pedestrian_crosses(
    speed: float = 12.0, walk: float = 1.4, seen_from_s: float = -math.inf, side: int = 1
) -> Evidence:
    """A pedestrian crosses from the kerb; the ego's middle meets it."""
    reach_s = (100.0 - CAR_M[0] / 2) / speed
    ego = straight(0.0, 0.0, 0.0, speed, start_s=0.0)
    walker = straight(100.0, side * walk * reach_s, -side * math.pi / 2, walk, start_s=0.0)
    return stage(ego, walker, kinds=WALKING, seen_from_s=seen_from_s, from_s=0.0)


def cut_in(
    gap: float = 12.0, ego: float = 14.0, other: float = 9.0, rate: float = 1.2, at_s: float = 2.0, side: int = 1
) -> Evidence:
    """A vehicle from the lane beside cuts in `gap` metres ahead."""
    ego_motion = straight(0.0, 0.0, 0.0, ego)
    start = ego * (at_s + 1.5) + CAR_M[0] + gap - other * (at_s + 1.5)
    beside = straight(start, side * LANE_M, 0.0, other)
    return stage(ego_motion, sideways(beside, at_s, -side * rate, LANE_M))


def hangs_over(at_s: float, comes_at_s: float) -> Evidence:
    """A neighbour hangs over by half a metre, and later comes over."""
    beside = sideways(straight(-1.5 * 12.0 + CAR_M[0] - 3.0, LANE_M, 0.0, 12.0), at_s, -1.2, 0.5)
    return stage(straight(-1.5 * 12.0, 0.0, 0.0, 12.0), sideways(beside, comes_at_s, -1.2, LANE_M - 0.5))


def merge(rate: float = 1.2, at_s: float = 2.0, side: int = 1, other_x: float = -2.0, speed: float = 12.0) -> Evidence:
    """The ego moves over to a neighbour that keeps lane and speed."""
    ego = sideways(straight(0.0, 0.0, 0.0, speed), at_s, side * rate, LANE_M)
    return stage(ego, straight(other_x, side * LANE_M, 0.0, speed))


def leader_brakes(gap: float = 20.0, speed: float = 14.0, braking: float = 8.0, at_s: float = 2.0) -> Evidence:
    """`gap` metres ahead at the ego's speed, it brakes to a standstill."""
    return stage(straight(0.0, 0.0, 0.0, speed), straight(CAR_M[0] + gap, 0.0, 0.0, speed, (at_s, -braking)))


def crossing_car(ego: float = 12.0, other: float = 12.0, side: int = -1, ahead: float = 0.0) -> Evidence:
    """Crossing car from the right (side -1) or left, `ahead` metres later."""
    t = 60.0 / ego
    return stage(
        straight(0.0, 0.0, 0.0, ego, start_s=0.0),
        straight(60.0 + ahead, side * other * t, -side * math.pi / 2, other, start_s=0.0),
        from_s=0.0,
    )
