import numpy as np
import pytest

from risk_sac.failures.recording import Recording, trajectory_digest
from tests.unit.failures.staged import JUDGED, synthetic_contact, synthetic_series, with_release


def test_pose_at_the_contact_lies_between_the_frames() -> None:
    recording = Recording(synthetic_contact(), synthetic_series())
    assert recording.pose(0, 0.0) == pytest.approx((280 + 19.5, -1.65, 0.0))
    assert recording.pose(recording.other, -0.95) == pytest.approx((302, -3.0, np.pi / 2))


def test_frames_before_the_release_come_before_it() -> None:
    recording = Recording(synthetic_contact(), with_release())
    assert len(recording.time_s) == 36
    assert (recording.time_s[0], recording.time_s[-1]) == pytest.approx((-3.45, 0.05))
    assert recording.time_s[15] == pytest.approx(recording.released_s) == -1.95
    assert recording.pose(0, 0.0) == pytest.approx((280 + 19.5, -1.65, 0.0))
    assert recording.pose(0, -2.95) == pytest.approx((270, -1.65, 0.0))


def test_the_conflict_begins_as_long_before_the_contact_as_its_judgement_says() -> None:
    for series in (synthetic_series(), with_release()):
        assert Recording(synthetic_contact(), series).conflict_s == pytest.approx(-1.2)
    early = JUDGED.model_copy(update={"conflict_s": -1.0})  # before the release
    assert Recording(synthetic_contact(early), with_release()).conflict_s == pytest.approx(-2.95)
    assert Recording(synthetic_contact(early), synthetic_series()).conflict_s is None  # which began at the release
    assert Recording(synthetic_contact(None), synthetic_series()).conflict_s is None


def test_hidden_span_ends_where_the_other_comes_into_view() -> None:
    recording = Recording(synthetic_contact(), synthetic_series())
    assert [tuple(np.round(span, 6)) for span in recording.hidden()] == [(-1.95, -0.85)]


def series() -> dict[str, np.ndarray]:
    return {
        "time_s": np.arange(4.0),
        "released_s": np.array(1.0),
        "ids": np.array(["ego", "a"]),
        "x_m": np.ones((4, 2)),
    }


def test_the_digest_is_of_the_arrays_and_of_nothing_else() -> None:
    backwards = dict(reversed(series().items()))
    backwards["x_m"] = np.asfortranarray(backwards["x_m"])
    assert trajectory_digest(backwards) == trajectory_digest(series())


@pytest.mark.parametrize(
    "change",
    [
        {"x_m": np.nextafter(np.ones((4, 2)), 2)},
        {"x_m": np.ones((2, 4))},
        {"x_m": np.ones((4, 2), np.float32)},
        {"y_m": np.ones((4, 2))},
        {"ids": np.array(["ego", "b"])},
    ],
    ids=["a bit", "shape", "type", "one more", "a name"],
)
def test_the_digest_changes_with_every_bit(change: dict[str, np.ndarray]) -> None:
    assert trajectory_digest(series() | change) != trajectory_digest(series())
