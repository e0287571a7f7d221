"""The shipped documents pose the scenes that their patterns posed before."""

import hashlib

import numpy as np
import pytest

from risk_sac.scenario.families import FAMILIES
from risk_sac.scenario.layout import Layout

# Of the layouts of 200 scenes each; equal to those of the three patterns in code that the documents replaced.
LAYOUTS = {"low": "a606a1677104072d", "mixed": "0794eb2ce480d8bf", "dense": "549a0423eb1db01d"}
VEHICLE = ("id", "role", "route", "lane", "position_m", "speed_mps", "body")
PEDESTRIAN = ("id", "role", "x_m", "y_m", "heading_rad", "speed_mps")
WHOLE = ("net", "crossings", "roadway", "junctions", "lane_width_m", "signal", "signal_offset_s", "friction", "wary")


def described(layout: Layout) -> str:
    vehicles = [[getattr(start, name) for name in VEHICLE] for start in (layout.ego, *layout.vehicles)]
    pedestrians = [[getattr(start, name) for name in PEDESTRIAN] for start in layout.pedestrians]
    return repr((vehicles, pedestrians, [getattr(layout, name) for name in WHOLE]))


@pytest.mark.parametrize("name", LAYOUTS)
def test_layouts_stay_equal(name: str) -> None:
    family, random = FAMILIES[name], np.random.default_rng(1)
    digest = hashlib.sha256()
    for _ in range(200):
        scene = family.space.from_unit(random.random(family.space.dimension))
        digest.update(described(family.layout(scene.values)).encode())
    assert digest.hexdigest()[:16] == LAYOUTS[name]
