from pathlib import Path

import numpy as np
import pytest

import sumo_nets
from risk_sac.config import FamilyName
from risk_sac.failures.net import read_net
from risk_sac.failures.signals import LETTERS, signal_heads
from risk_sac.scenario.families import FAMILIES


def scene(family: FamilyName, offset_s: float) -> dict[str, float]:
    parameters = FAMILIES[family].space.parameters
    return {each.name: (each.low + each.high) / 2 for each in parameters} | {"signal_offset_s": offset_s}


@pytest.mark.parametrize("offset_s", [0.0, 7.1, 34.8])
@pytest.mark.parametrize(("family", "heads"), [("low", 0), ("mixed", 6), ("dense", 16)])
def test_heads_show_what_the_program_shows_from_where_the_scene_puts_it(
    family: FamilyName, heads: int, offset_s: float
) -> None:
    found = signal_heads(family, scene(family, offset_s))
    assert len(found) == heads
    net = read_net(Path(sumo_nets.__path__[0]) / family / f"{family}.net.xml")
    ends = {tuple(lane.centre[-1]): lane for lane in net.lanes.values() if lane.heads}
    compared = 0
    for head in found:
        lane = ends.get((head.x_m, head.y_m))
        if lane is None:
            continue  # the other end of a crossing
        link = next(each for each in lane.heads if each.turn == "s")
        for time_s in np.arange(0.1, 25.0, 0.1):
            letters = net.signals[link.signal].letters(offset_s + time_s)
            assert head.colour(time_s) == LETTERS[letters[link.index].lower()]
        compared += 1
    assert compared == len(ends)
