from pathlib import Path

import pytest

import sumo_nets
from risk_sac.failures.net import read_net, surfaces

NETS = Path(sumo_nets.__path__[0])


@pytest.mark.parametrize(("family", "lanes", "crossings"), [("low", 3, 0), ("mixed", 12, 2), ("dense", 16, 4)])
def test_nets_have_the_lanes_and_crossings_of_their_family(family: str, lanes: int, crossings: int) -> None:
    uses = [surface.use for surface in surfaces(read_net(NETS / family / f"{family}.net.xml"))]
    assert (uses.count("lane"), uses.count("crossing")) == (lanes, crossings)
