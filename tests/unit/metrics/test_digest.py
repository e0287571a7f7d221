import math
from types import MappingProxyType

import pytest

from risk_sac.metrics import results_digest
from tests.unit.metrics.episodes import RUN, episode


def test_digest_is_the_hash_of_canonical_json():
    assert results_digest([]) == "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855"
    assert results_digest(RUN) == results_digest(list(RUN))


def test_digest_does_not_depend_on_the_order_or_kind_of_mappings():
    scene = {"gap_m": 10.0, "speed_mps": 12.5}
    turned = MappingProxyType(dict(reversed(scene.items())))
    assert results_digest([episode(scene=scene)]) == results_digest([episode(scene=turned)])


@pytest.mark.parametrize(
    "change", [{"risk_return": math.nextafter(1.0, 2)}, {"steps": 149}, {"scene": {"gap_m": 10.0}}, {"objective": None}]
)
def test_digest_notices_the_smallest_change(change):
    assert results_digest([RUN[1].model_copy(update=change)]) != results_digest([RUN[1]])
    assert results_digest(RUN[::-1]) != results_digest(RUN)
