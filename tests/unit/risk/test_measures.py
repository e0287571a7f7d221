import numpy as np
import pytest

from risk_sac.config import Requirement
from risk_sac.risk.measures import Gauge, Measures, soft_min
from risk_sac.risk.own_motion import OwnMotionGauge
from risk_sac.risk.publish import assess, publish
from risk_sac.risk.rss_parameters import RssParameters
from risk_sac.scenario.carriageway import Carriageway
from risk_sac.types import Frame
from tests.builders import frame_of

RSS = RssParameters(response_s=0.5, brake_min_mps2=6.0, brake_max_mps2=6.0)
SEEN = np.array([True])
REQUIREMENTS = (
    Requirement(name="far", formula="vehicle_gap_m >= 10", scale=10.0),
    Requirement(name="apart", formula="historically(vehicle_gap_m >= 5)", scale=10.0),
)


def gauge() -> Gauge:
    return Gauge(REQUIREMENTS, 100, RSS, softmin_sharpness=20.0)


def behind(gap_m: float) -> Frame:
    """The ego at 10 m/s, and an actor that stands ahead of it."""
    return frame_of(x_m=[0.0, gap_m + 4.6], speed_mps=[10.0, 0.0])


def measured(subject: Gauge, *gaps_m: float) -> list[Measures]:
    return [subject.measure(behind(gap_m), None, SEEN) for gap_m in gaps_m]


def test_a_frame_is_measured_by_the_functions_of_the_paper() -> None:
    (measures,) = measured(gauge(), 20.0)
    assessment = assess(behind(20.0), RSS, SEEN)
    assert np.array_equal(measures.assessment.others, assessment.others)
    own = OwnMotionGauge().measure(behind(20.0))
    assert measures.signals == publish(behind(20.0), None, assessment.least, own)
    assert measures.robustness.tolist() == pytest.approx([1.0, 1.5])
    assert measures.soft_min == soft_min(measures.robustness, 20.0)


def test_an_actor_that_was_touched_in_the_step_and_is_past_has_no_gap_left() -> None:
    measures = gauge().measure(behind(0.7), None, SEEN, struck=1)
    assert measures.signals["vehicle_gap_m"] == measures.signals["ttc_s"] == measures.signals["encounter_s"] == 0.0
    assert measures.robustness.tolist() == pytest.approx([-1.0, -0.5])


def test_requirements_remember_the_frames_of_an_episode_and_nothing_before_it() -> None:
    subject = gauge()
    assert [m.robustness[1] for m in measured(subject, 20.0, 8.0, 20.0)] == pytest.approx([1.5, 0.3, 0.3])
    subject.reset(Carriageway())
    assert measured(subject, 20.0)[0].robustness[1] == pytest.approx(1.5)
