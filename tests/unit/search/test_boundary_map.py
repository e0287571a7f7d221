"""Maps of known boundaries over three and four parameters, others drawn too."""

from itertools import pairwise

import numpy as np
import pytest

from risk_sac.config import RunSpec
from risk_sac.config.campaign import BoundaryConfig
from risk_sac.env.problem import Problem
from risk_sac.records import Outcome
from risk_sac.report import parameter_plots as drawing
from risk_sac.report.parameter_plots import boundary_png
from risk_sac.search.boundary_map import boundary_map
from risk_sac.search.scene_optimizer.base import sobol_points
from tests.builders import collision, episode_record

FAMILY = "motorway_cut_in"
THREE = ("cutter_ahead_m", "cutter_slower_mps", "ego_speed_mps")
POINTS = 120


def mapped(over, fails, others="fixed"):
    """Maps episodes that fail where `fails`, over unit coordinates by name, says."""
    config = BoundaryConfig(over=over, others=others)
    spec = RunSpec(family=FAMILY, method="boundary", seed=0, boundary=config)
    problem = Problem.from_spec(spec)
    slice_ = problem.slice_of(spec)
    records = []
    for index, point in enumerate(sobol_points(len(over), 3, count=POINTS).numpy()):
        whole = slice_.whole(point, np.random.default_rng(index))
        failed = fails(dict(zip(problem.space.names, whole, strict=True)))
        outcome = Outcome.FAILURE if failed else Outcome.SAFE
        scene = problem.space.from_unit(whole).values
        records.append(episode_record(index, outcome, scene=scene, collision=collision() if failed else None))
    return boundary_map(spec, records)


def across(unit):
    return unit["cutter_ahead_m"] + unit["ego_speed_mps"] < 0.8  # of the box 0.32; the other axis has no effect


def test_three_axes_have_slices_of_the_third_and_name_the_one_without_effect():
    found = mapped(THREE, across)
    ego = found.maps[0]
    assert [len(axis.levels) for axis in found.axes] == [21, 21, 3]
    assert len(ego.probability) == 21 * 21 * 3
    assert ego.fails.low <= 0.32 <= ego.fails.high
    shares = (np.array(ego.probability).reshape(21, 21, 3) > 0.5).mean(axis=(0, 1))
    assert all(left > right for left, right in pairwise(shares))  # the faster the ego, the less fails
    assert [axis.has_effect for axis in found.axes] == [True, False, True]
    assert "cutter_slower_mps has no effect on passing or failing here." in found.notes


@pytest.mark.parametrize(("over", "panels"), [(THREE[:2], 1), (THREE, 3), ((*THREE, "lead_time_gap_s"), 9)])
def test_a_picture_has_a_panel_for_each_slice_and_every_point_once(monkeypatch, over, panels):
    seen = []
    monkeypatch.setattr(drawing, "_scatter", lambda axes, found, cut: seen.append(cut))
    found = mapped(over, across if len(over) > 2 else lambda unit: unit["cutter_ahead_m"] < 0.4)
    assert boundary_png(found).startswith(b"\x89PNG")
    assert len(set(seen)) == panels
    nearest = [drawing._nearest(found, point.values[2:]) for point in found.points]
    assert set(nearest) <= set(seen)


def test_a_panel_says_which_points_it_shows():
    axis = mapped(THREE, across).axes[2]  # 22 to 34 m/s
    assert [drawing._slice_words(axis, level) for level in range(3)] == [
        "ego_speed_mps = 24 (points: 22 to 26)",
        "ego_speed_mps = 28 (points: 26 to 30)",
        "ego_speed_mps = 32 (points: 30 to 34)",
    ]


def test_with_others_drawn_the_boundary_is_where_half_of_the_scenes_fail():
    def half(unit):  # at cutter_ahead 0.5 half of the drawn leaders' gaps fail
        return unit["cutter_ahead_m"] + 0.5 * (unit["lead_time_gap_s"] - 0.5) < 0.5

    found = mapped(THREE[:2], half, others="drawn")
    share = (np.array(found.maps[0].probability).reshape(25, 25) > 0.5).mean()
    assert share == pytest.approx(0.5, abs=0.08)
    assert found.fixed == {}
    assert any(note.startswith("The other parameters are drawn") for note in found.notes)


def test_with_others_drawn_and_no_boundary_nothing_is_said_of_what_lies_beyond_it():
    notes = mapped(THREE[:2], lambda unit: False, others="drawn").notes
    assert notes == (
        f"The ego fails in 0 of {POINTS} scenes: there is no boundary in this box.",
        "The other parameters are drawn.",
    )
