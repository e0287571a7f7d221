from pathlib import Path

import numpy as np
import pytest

import sumo_nets
from risk_sac.config import FamilyName
from risk_sac.failures.net import read_net, ribbon, roads_of, surfaces
from risk_sac.scenario.families import FAMILIES

NETS = Path(sumo_nets.__path__[0])


def test_lane_is_a_ribbon_of_its_width_around_its_centre_line() -> None:
    straight = ribbon(np.array([(0.0, 0.0), (10.0, 0.0)]), 2.0)
    np.testing.assert_allclose(straight, [(0, 1), (10, 1), (10, -1), (0, -1)])


@pytest.mark.parametrize(("family", "lanes", "crossings"), [("low", 3, 0), ("mixed", 12, 2), ("dense", 16, 4)])
def test_nets_have_the_lanes_and_crossings_of_their_family(family: str, lanes: int, crossings: int) -> None:
    uses = [surface.use for surface in surfaces(read_net(NETS / family / f"{family}.net.xml"))]
    assert (uses.count("lane"), uses.count("crossing")) == (lanes, crossings)


@pytest.mark.parametrize("family", FAMILIES)
def test_a_scene_has_the_surfaces_of_its_net(family: FamilyName) -> None:
    space = FAMILIES[family].space
    scene = {parameter.name: (parameter.low + parameter.high) / 2 for parameter in space.parameters}
    read = surfaces(read_net(NETS / family / f"{family}.net.xml"))
    for surface, wanted in zip(roads_of(family, scene), read, strict=True):
        assert surface.use == wanted.use
        np.testing.assert_array_equal(surface.outline, wanted.outline)
    assert roads_of(family, scene) is roads_of(family, scene), "a net is read once"
