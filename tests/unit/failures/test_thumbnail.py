import re
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from shapely import Polygon, box

from risk_sac.failures.net import roads_of
from risk_sac.failures.recording import Recording
from risk_sac.failures.thumbnail import EGO, HEIGHT, STRIKER, WIDTH, thumbnail
from risk_sac.run_folder.results import RecordedFailure
from tests.builders import violation
from tests.unit.failures.staged import synthetic_contact, synthetic_series

SVG = "{http://www.w3.org/2000/svg}"


def drawn(series: Mapping[str, Any], roads: bool = True) -> list[ET.Element]:
    """The shapes, as a reader of XML finds them."""
    contact = synthetic_contact()
    text = thumbnail(Recording(contact, series), roads_of("mixed", contact.episode.scene) if roads else ())
    root = ET.fromstring(text)
    assert (root.tag, root.get("viewBox")) == (f"{SVG}svg", f"0 0 {WIDTH} {HEIGHT}")
    assert not re.search(r"nan|inf|\d\.\d\d", text)
    return list(root)


def points(shape: ET.Element) -> np.ndarray:
    return np.array([[float(value) for value in point.split(",")] for point in shape.get("points", "").split()])


def body(shapes: list[ET.Element], colour: str) -> ET.Element:
    (found,) = (shape for shape in shapes if shape.get("fill") == colour)
    return found


def turned(series: Mapping[str, Any], by_rad: float, far_m: float = 0.0) -> dict[str, Any]:
    """The same encounter elsewhere and in another direction."""
    cos, sin = np.cos(by_rad), np.sin(by_rad)
    x, y = series["x_m"] - 300.0, series["y_m"]
    place = {"x_m": x * cos - y * sin + far_m, "y_m": x * sin + y * cos - far_m}
    return dict(series) | place | {"heading_rad": series["heading_rad"] + by_rad}


@pytest.mark.parametrize("by_rad", np.linspace(0, 2 * np.pi, 9))
@pytest.mark.parametrize("far_m", [0.0, 700.0])
def test_both_bodies_are_seen_and_touch_whatever_their_direction(by_rad: float, far_m: float) -> None:
    shapes = drawn(turned(synthetic_series(), by_rad, far_m), roads=False)
    ego, walker = Polygon(points(body(shapes, EGO))), body(shapes, STRIKER)
    assert box(0, 0, WIDTH, HEIGHT).contains(ego)
    left, top, radius = (float(walker.get(name, "")) for name in ("cx", "cy", "r"))
    assert 0 < left < WIDTH
    assert 0 < top < HEIGHT
    assert ego.distance(box(left, top, left, top)) <= radius
    length, width = sorted(np.hypot(*np.diff(points(body(shapes, EGO)), axis=0).T))[::-2]
    series = synthetic_series()
    assert length / width == pytest.approx(series["length_m"][0] / series["width_m"][0], rel=0.05)


def test_north_is_up_and_an_arrow_head_points_to_where_a_car_heads() -> None:
    for by_rad, ahead in ((0.0, (1, 0)), (np.pi / 2, (0, -1)), (np.pi, (-1, 0))):
        shapes = drawn(turned(synthetic_series(), by_rad), roads=False)
        (head,) = (shape for shape in shapes if shape.get("fill") == "#fff")
        _, tip, _ = points(head)
        away = tip - points(body(shapes, EGO)).mean(axis=0)
        np.testing.assert_allclose(away / np.hypot(*away), ahead, atol=0.1)


def test_a_violation_near_nothing_shows_the_ego_and_its_path_up_to_then() -> None:
    episode = synthetic_contact().episode.model_copy(update={"collision": None, "violations": (violation(time_s=1.0),)})
    shapes = list(ET.fromstring(thumbnail(Recording(RecordedFailure.of("a", episode), synthetic_series()), ())))
    assert not [shape for shape in shapes if shape.get("fill") == STRIKER]
    (path,) = (shape for shape in shapes if shape.get("stroke") == EGO)
    assert len(points(path)) == pytest.approx(11, abs=1)
    end, ego = points(path)[-1], points(body(shapes, EGO)).mean(axis=0)
    np.testing.assert_allclose(end, ego, atol=5.0)
