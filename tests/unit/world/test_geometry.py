"""Our box geometry against shapely, which knows nothing of separating axes."""

import math

import numpy as np
import pytest
import shapely

from risk_sac.world.geometry import RelativeView, line_of_sight, overlapping_pairs, relative_view, time_to_contact
from risk_sac.world.types import Bools, Floats, Frame
from tests import builders

TOUCHING_M = 1e-9
Rows = list[tuple[float, ...]]  # x, y, heading, length, width, and optionally vx, vy


def frame_of(rows: Rows) -> Frame:
    x, y, heading, length, width, vx, vy = np.array([(*row, 0.0, 0.0)[:7] for row in rows]).T
    return builders.frame_of(x_m=x, y_m=y, heading_rad=heading, vx_mps=vx, vy_mps=vy, length_m=length, width_m=width)


def view_of(rows: Rows) -> RelativeView:
    return relative_view(frame_of(rows))


def polygons(x: Floats, y: Floats, heading: Floats, length: Floats, width: Floats) -> shapely.Polygon:
    """World-frame boxes by rotating each corner; `n`."""
    along = np.multiply.outer(length / 2, (1.0, 1.0, -1.0, -1.0))
    across = np.multiply.outer(width / 2, (1.0, -1.0, -1.0, 1.0))
    cos, sin = np.cos(heading)[:, None], np.sin(heading)[:, None]
    corner_x, corner_y = x[:, None] + along * cos - across * sin, y[:, None] + along * sin + across * cos
    return shapely.polygons(np.stack((corner_x, corner_y), axis=2))


def boxes(frame: Frame) -> shapely.Polygon:
    return polygons(frame.x_m, frame.y_m, frame.heading_rad, frame.length_m, frame.width_m)


def random_frame(generator: np.random.Generator, n: int, spread_m: float) -> Frame:
    """An ego anywhere with `n` cars, lorries and pedestrians about it."""
    x0, y0 = generator.uniform(-500, 500, 2)
    ego = (x0, y0, generator.uniform(-9, 9), generator.uniform(3, 12), generator.uniform(1.5, 2.6))
    rows = np.column_stack(
        (
            x0 + generator.uniform(-spread_m, spread_m, n),
            y0 + generator.uniform(-spread_m, spread_m, n),
            generator.uniform(-9, 9, n),
            generator.uniform(0.4, 12, n),
            generator.uniform(0.4, 2.6, n),
        )
    )
    velocity = generator.uniform(-15, 15, (n, 2))
    return frame_of([(*ego, *generator.uniform(-15, 15, 2)), *map(tuple, np.hstack((rows, velocity)))])


def test_overlap_agrees_with_shapely_on_10000_random_pose_pairs():
    generator = np.random.default_rng(0)
    found, expected, distances = [], [], []
    for _ in range(100):
        frame = random_frame(generator, 100, 9.0)
        bodies = boxes(frame)
        found.append(relative_view(frame).overlap)
        expected.append(shapely.intersects(bodies[0], bodies[1:]))
        overlap = shapely.area(shapely.intersection(bodies[0], bodies[1:]))
        distances.append(shapely.distance(bodies[0], bodies[1:]) + overlap)
    ours, theirs = np.concatenate(found), np.concatenate(expected)
    touching = np.concatenate(distances) < TOUCHING_M
    assert len(ours) == 10_000
    assert 0.2 < theirs.mean() < 0.8  # both answers are well covered
    assert np.array_equal(ours[~touching], theirs[~touching])
    assert touching.sum() <= 5


def test_overlapping_pairs_are_the_pairs_that_shapely_sees_intersect():
    generator = np.random.default_rng(2)
    found = 0
    for _ in range(300):
        frame = random_frame(generator, 8, 12.0)  # eight others and the ego
        bodies = boxes(frame)
        pairs = overlapping_pairs(frame.state)
        expected = [(i, j) for i in range(9) for j in range(i + 1, 9) if shapely.intersects(bodies[i], bodies[j])]
        assert pairs == expected
        found += len(pairs)
    assert found > 500


@pytest.mark.parametrize("heading", [0.0, 0.3, math.pi / 2, -2.5])
def test_bodies_touch_at_contact_and_not_a_millimetre_before(heading):
    def rear_end(gap_m):
        ahead = 4.6 + gap_m
        view = view_of(
            [(0, 0, heading, 4.6, 1.85), (ahead * math.cos(heading), ahead * math.sin(heading), heading, 4.6, 1.85)]
        )
        return bool(view.overlap[0])

    assert rear_end(-0.001)
    assert not rear_end(0.001)


@pytest.mark.parametrize("spread_m", [9.0, 25.0])
def test_gap_is_the_distance_that_shapely_measures(spread_m):
    generator = np.random.default_rng(1)
    for _ in range(20):
        frame = random_frame(generator, 100, spread_m)
        bodies = boxes(frame)
        distance, gap = shapely.distance(bodies[0], bodies[1:]), relative_view(frame).gap
        np.testing.assert_allclose(gap, distance, atol=1e-9)
        assert np.all((gap > 0) == (distance > 0))


def test_a_lone_ego_has_an_empty_view():
    view = view_of([(3, 4, 1, 4.6, 1.85)])
    assert view.overlap.shape == view.gap.shape == time_to_contact(view).shape == (0,)
    assert line_of_sight(view, np.zeros(0, dtype=np.bool_)).shape == (0,)


@pytest.mark.parametrize(
    ("other", "ttc_s"),
    [
        pytest.param((24.6, 0, 0, 4.6, 1.85, 10, 0), 2.0, id="leader: 20 m gap closed at 10 m/s"),
        pytest.param((24.6, 0, 0, 4.6, 1.85, 25, 0), math.inf, id="leader pulls away"),
        pytest.param((24.6, 0, 0, 4.6, 1.85, 20, 0), math.inf, id="leader at the same speed"),
        pytest.param((-24.6, 0, 0, 4.6, 1.85, 30, 0), 2.0, id="follower: 20 m gap closed at 10 m/s"),
        pytest.param((64.6, 0, math.pi, 4.6, 1.85, -10, 0), 2.0, id="oncoming: 60 m closed at 30 m/s"),
        pytest.param((64.6, 3.3, math.pi, 4.6, 1.85, -10, 0), math.inf, id="oncoming in the next lane"),
        # Crossing from the right at 10 m/s, its front 20 m from the line of the ego's flank, which it reaches at 2 s.
        pytest.param((40, -23.225, math.pi / 2, 4.6, 1.85, 0, 10), 2.0, id="crossing: it strikes the ego's flank"),
        pytest.param((50, -23.225, math.pi / 2, 4.6, 1.85, 0, 10), 2.33875, id="crossing: the ego strikes its flank"),
        pytest.param((100, -23.225, math.pi / 2, 4.6, 1.85, 0, 10), math.inf, id="crossing: it passes ahead"),
        pytest.param((50, -43.225, math.pi / 2, 4.6, 1.85, 0, 10), math.inf, id="crossing: it passes behind"),
        pytest.param((0, -23.225, math.pi / 2, 4.6, 1.85, 20, 10), 2.0, id="closing sideways while keeping abreast"),
        pytest.param((0, 0.5, 0, 4.6, 1.85, 20, 0), 0.0, id="already touching"),
    ],
)
def test_time_to_contact_matches_the_hand_computed_value(other, ttc_s):
    assert time_to_contact(view_of([(0, 0, 0, 4.6, 1.85, 20, 0), other]))[0] == pytest.approx(ttc_s)


def stepped_time_to_contact(frame: Frame, horizon_s: float, step_s: float) -> Floats:
    """First sampled instant of contact by shapely; inf up to the horizon."""
    first = np.full(len(frame.ids) - 1, np.inf)
    for time_s in np.arange(0.0, horizon_s, step_s):
        bodies = polygons(
            frame.x_m + frame.vx_mps * time_s,
            frame.y_m + frame.vy_mps * time_s,
            frame.heading_rad,
            frame.length_m,
            frame.width_m,
        )
        hit = shapely.intersects(bodies[0], bodies[1:])
        first[hit & np.isinf(first)] = time_s
    return first


def test_time_to_contact_agrees_with_stepping_the_bodies_forward():
    generator, horizon_s, step_s = np.random.default_rng(2), 4.0, 0.01
    hits = 0
    for _ in range(8):
        frame = random_frame(generator, 100, 40.0)
        ttc = time_to_contact(relative_view(frame))
        stepped = stepped_time_to_contact(frame, horizon_s, step_s)
        found = np.isfinite(stepped)
        hits += int(found.sum())
        assert np.all(ttc[found] <= stepped[found] + 1e-9)
        assert np.all(ttc[found] >= stepped[found] - step_s - 1e-9)
        # A contact between two samples may be missed by stepping, but then it is a graze.
        grazed = ~found & (ttc < horizon_s - step_s)
        for i in np.flatnonzero(grazed):
            at = ttc[i] + 1e-6
            bodies = polygons(
                *(a + v * at for a, v in ((frame.x_m, frame.vx_mps), (frame.y_m, frame.vy_mps))),
                frame.heading_rad,
                frame.length_m,
                frame.width_m,
            )
            assert bodies[0].distance(bodies[i + 1]) < 1e-4
        assert grazed.sum() <= 2
    assert hits > 50


def seen_by_rays(frame: Frame, occludes: Bools) -> tuple[Bools, Bools]:
    """Bodies that shapely's segments from the ego reach, and whether clear-cut.

    A ray blocked by a sliver shorter than a micrometre, or missing a wall by as little, is no clear case.
    """
    bodies = boxes(frame)
    others = bodies[1:]
    n = len(others)
    seen, sure = np.zeros(n, dtype=np.bool_), np.ones(n, dtype=np.bool_)
    start = (frame.x_m[0], frame.y_m[0])
    for i in range(n):
        walls = [others[j] for j in range(n) if occludes[j] and j != i]
        targets = [(frame.x_m[i + 1], frame.y_m[i + 1]), *list(others[i].exterior.coords)[:4]]
        for target in targets:
            ray = shapely.LineString([start, target])
            inside = [ray.intersection(wall).length for wall in walls]
            near = [ray.distance(wall) for wall in walls]
            if all(length == 0 for length in inside):
                seen[i] = True
            if any(0 < length < 1e-6 for length in inside) or any(0 < d < 1e-6 for d in near):
                sure[i] = False
    return seen, sure


def test_line_of_sight_agrees_with_shapely_rays():
    generator = np.random.default_rng(3)
    compared, hidden = 0, 0
    for _ in range(60):
        frame = random_frame(generator, 12, 35.0)
        occludes = generator.random(12) < 0.7
        seen, sure = seen_by_rays(frame, occludes)
        ours = line_of_sight(relative_view(frame), occludes)
        assert np.array_equal(ours[sure], seen[sure])
        compared, hidden = compared + int(sure.sum()), hidden + int((~seen[sure]).sum())
    assert compared > 600
    assert hidden > 60


def test_the_view_does_not_depend_on_where_the_world_has_its_origin():
    frame = random_frame(np.random.default_rng(4), 20, 20.0)
    turn, shift = 1.1, (1000.0, -300.0)
    cos, sin = math.cos(turn), math.sin(turn)
    rows = zip(
        cos * frame.x_m - sin * frame.y_m + shift[0],
        sin * frame.x_m + cos * frame.y_m + shift[1],
        frame.heading_rad + turn,
        frame.length_m,
        frame.width_m,
        cos * frame.vx_mps - sin * frame.vy_mps,
        sin * frame.vx_mps + cos * frame.vy_mps,
        strict=True,
    )
    moved = frame_of(list(rows))
    one, other = relative_view(frame), relative_view(moved)
    for name in ("x", "y", "vx", "vy", "gap"):
        np.testing.assert_allclose(getattr(one, name), getattr(other, name), atol=1e-9)
    np.testing.assert_allclose(time_to_contact(one), time_to_contact(other), rtol=1e-6)
