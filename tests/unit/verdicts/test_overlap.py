import pytest

from risk_sac.types import Kind
from risk_sac.verdicts.overlap import Overlap, overlaps_before_contact
from tests.unit.verdicts.staged import cut_in, mirrored, pedestrian_crosses, stage, straight

CAR = Kind.VEHICLE


@pytest.mark.parametrize("evidence", [cut_in(), pedestrian_crosses()], ids=["vehicle", "pedestrian"])
def test_the_two_that_touch_at_the_end_are_no_overlap(evidence) -> None:  # type: ignore[no-untyped-def]
    assert overlaps_before_contact(evidence) == []


def test_every_frame_in_which_two_others_overlap_is_found_and_named() -> None:
    # The third passes through the fourth, 4.6 m long, at 10 m/s: it is inside it for 0.92 s.
    passing, standing = straight(-10.0, 6.0, 0.0, 10.0, start_s=0.0), straight(0.0, 6.0, 0.0, 0.0)
    ego, struck = straight(0.0, 0.0, 0.0, 10.0, start_s=0.0), straight(50.0, 0.0, 0.0, 0.0)
    evidence = stage(ego, struck, passing, standing, kinds=(CAR,) * 4, from_s=0.0)
    found = overlaps_before_contact(evidence)
    assert {each[1:] for each in found} == {("actor_2", "actor_3")}
    assert [each.time_s for each in found] == pytest.approx([t / 10 for t in range(6, 15)])
    assert overlaps_before_contact(mirrored(evidence)) == found


def test_a_pedestrian_inside_a_vehicle_is_an_overlap() -> None:
    walker, truck = straight(30.0, 4.0, 0.0, 0.0), straight(29.0, 4.0, 0.0, 0.0)
    ego, struck = straight(0.0, 0.0, 0.0, 10.0, start_s=0.0), straight(6.0, 0.0, 0.0, 0.0)
    evidence = stage(ego, struck, walker, truck, kinds=(CAR, CAR, Kind.PEDESTRIAN, CAR), from_s=0.0)
    assert overlaps_before_contact(evidence)[0] == Overlap(0.0, "actor_2", "actor_3")
