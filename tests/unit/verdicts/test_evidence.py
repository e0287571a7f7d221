import numpy as np
import pytest

from risk_sac.types import Frame
from risk_sac.verdicts.evidence import PER_ACTOR, Evidence, Ground
from risk_sac.verdicts.judge import judge
from tests.builders import frame_of
from tests.unit.verdicts.staged import STREET, cut_in, leader_brakes, stage, straight


def frame(time_s: float, ids: tuple[str, ...]) -> Frame:
    rows = np.array([float(id_[-1]) for id_ in ids])
    moving = dict.fromkeys(("y_m", "vx_mps", "vy_mps", "speed_mps", "lateral_mps", "accel_mps2", "lane_offset_m"), rows)
    return frame_of(time_s=time_s, ids=ids, x_m=rows + time_s, link=[ord("r")] * len(ids), **moving)


def test_frames_become_columns_of_the_first_frames_actors() -> None:
    frames = [frame(0.1, ("a0", "a1", "a2")), frame(0.2, ("a0", "a2")), frame(0.3, ("a0", "a2"))]
    known = [np.array([True, False, True]), np.array([True, True]), np.array([True, False])]
    evidence = Evidence.of(frames, known, 0.2, Ground())
    assert evidence.time_s == pytest.approx([-0.1, 0.0, 0.1])
    assert evidence.x_m[:, 0] == pytest.approx([0.1, 0.2, 0.3])
    assert evidence.x_m[:, 2] == pytest.approx([2.1, 2.2, 2.3])
    assert evidence.x_m[0, 1] == pytest.approx(1.1)
    assert np.isnan(evidence.x_m[1:, 1]).all()
    assert evidence.known.tolist() == [[True, False, True], [True, False, True], [True, False, False]]
    assert evidence.link[:, 2].tolist() == [ord("r")] * 3
    assert evidence.link[1, 1] == 0


@pytest.mark.parametrize("frames", [0, 2])
def test_known_goes_with_the_frames(frames: int) -> None:
    with pytest.raises(ValueError, match="wanted one of each per step"):
        Evidence.of([frame(0.1, ("a0",))] * frames, [np.array([True])], 0.0, Ground())


def test_a_striker_that_has_left_cannot_have_struck() -> None:
    evidence = Evidence.of(
        [frame(0.1, ("a0", "a1")), frame(0.2, ("a0",))], [np.ones(2, bool), np.ones(1, bool)], 0.0, Ground()
    )
    with pytest.raises(ValueError, match="'a1' has left"):
        evidence.column("a1")
    with pytest.raises(ValueError, match="'a0' is not among"):
        evidence.column("a0")


@pytest.mark.parametrize("evidence", [cut_in(), leader_brakes()], ids=["cut-in", "leader"])
def test_what_is_stored_is_judged_alike(evidence: Evidence) -> None:
    names = (*PER_ACTOR, "link", "kind", "role", "length_m", "width_m")
    stored = {name: getattr(evidence, name) for name in names} | {"ids": np.array(evidence.ids)}
    stored |= {"time_s": evidence.time_s + 1.5, "visible": np.where(evidence.known, 1.0, np.nan)}
    first = judge(evidence, "actor_1", valid=True)
    again = judge(Evidence.from_series(stored, STREET, 1.5), "actor_1", valid=True)
    assert (again.conflict_s, again.noticed_s) == pytest.approx((first.conflict_s, first.noticed_s))
    assert again.model_copy(update={"conflict_s": first.conflict_s, "noticed_s": first.noticed_s}) == first


def test_offsets_are_unwrapped_over_lane_changes() -> None:
    evidence = cut_in(rate=1.2, at_s=2.0)
    offset = evidence.unwrapped_offset_m(1)
    assert offset[0] == pytest.approx(0.0, abs=1e-9)
    assert np.abs(np.diff(offset)).max() <= 0.12 + 1e-9
    assert offset[-1] == pytest.approx(evidence.y_m[-1, 1] - 3.3)


def test_the_last_seconds_are_counted_from_the_contact() -> None:
    evidence = stage(straight(0.0, 0.0, 0.0, 10.0), straight(60.0, 0.0, 0.0, 0.0))
    assert evidence.time_s[-1] - evidence.time_s[evidence.since(2.0)] == pytest.approx(2.0)
    assert evidence.since(100.0) == 0
