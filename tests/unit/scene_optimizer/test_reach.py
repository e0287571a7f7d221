"""How far scenes are looked for: by worths worked out by hand."""

import pytest

from risk_sac.scene_optimizer.reach import EXPECTED, EXPECTED_SCENES, KEPT, LEAST, Reach


def test_what_was_not_tried_is_as_likely() -> None:
    assert Reach().near == 0.5


def test_the_chance_follows_what_came_of_either() -> None:
    reach = Reach()
    reach.tell(0.25, near=True)
    reach.tell(None, near=False)  # a rejected scene is worth nothing
    reach.tell(0.2, near=False)
    reach.tell(0.5, near=True)
    reach.tell(7.0, near=True)  # so is what lies far behind the best
    near = (EXPECTED * EXPECTED_SCENES + KEPT**2 * 0.75 + KEPT * 0.5) / (EXPECTED_SCENES + KEPT**2 + KEPT + 1)
    anywhere = (EXPECTED * EXPECTED_SCENES + 0.8) / (EXPECTED_SCENES + KEPT + 1)
    assert reach.near == pytest.approx(near**2 / (near**2 + anywhere**2))


@pytest.mark.parametrize("near", [False, True])
def test_neither_is_given_up(near: bool) -> None:
    reach = Reach()
    for _ in range(200):
        reach.tell(0.0, near=near)
        reach.tell(1.0, near=not near)
    assert reach.near == pytest.approx(1.0 - LEAST if near else LEAST)


def test_it_goes_on_from_its_state() -> None:
    reach, other = Reach(), Reach()
    reach.tell(0.3, near=True)
    other.load(reach.state())
    assert other.near == reach.near != 0.5
    other.tell(0.1, near=False)  # the state is a copy
    assert other.near != reach.near
