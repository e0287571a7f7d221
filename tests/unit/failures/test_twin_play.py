import math

import numpy as np

from risk_sac.failures.question import TwinPlay, read_twin, twin_bytes
from tests.builders import collision, violation
from tests.unit.failures.staged import synthetic_series


def test_a_twin_reads_back_with_its_series_and_what_is_not_finite() -> None:
    hit = collision(min_ttc_s=math.inf)
    play = TwinPlay.of(None, hit, [hit])
    read, series = read_twin(twin_bytes(play, synthetic_series()))
    assert read == play
    assert series.keys() == synthetic_series().keys()
    for name, array in synthetic_series().items():
        np.testing.assert_array_equal(series[name], array)


def test_the_twin_of_a_violation_says_whether_it_keeps_that_requirement() -> None:
    broken, hit = violation(), collision(other_id="lead", ego_speed_mps=12.3, relative_speed_mps=1.34)
    assert TwinPlay.of(None, broken, []).outcome == "keeps never_fast"
    assert TwinPlay.of(None, broken, [broken]).outcome == "violates never_fast after 1.5 s, at 9.0 m/s"
    told = TwinPlay.of(None, broken, [hit])
    assert (told.outcome, told.collision) == ("keeps never_fast, touches lead at a closing speed of 1.3 m/s", hit)
    assert TwinPlay.of(None, hit, [broken]).outcome == "no contact, violates never_fast after 1.5 s, at 9.0 m/s"
