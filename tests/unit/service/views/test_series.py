import json
import math

import numpy as np
import pytest

from risk_sac.failures.question import TwinPlay, twin_bytes
from risk_sac.records import wire
from risk_sac.run_folder.series import write_series
from service.errors import StorageError
from service.views.pictures import twin_body
from service.views.series import load_series
from tests.builders import collision, judgement
from tests.contract.recorded_campaigns import series_arrays


def test_a_series_is_plain_and_null_where_an_actor_is_absent(tmp_path):
    write_series(tmp_path / "a.npz", series_arrays())
    series = load_series(tmp_path / "a.npz", None)
    assert series.x_m == [[0.0, 1.0], [2.0, None], [4.0, 5.0]]
    assert series.visible == [[None, True], [None, None], [None, False]]
    assert series.kind == ["vehicle", "pedestrian"]
    assert series.role == ["ego", "adversary"]
    assert series.signal == ["none", "red", "green"]
    assert series.robustness == [[1.0], [None], [-1.0]]
    assert len(series.actions[0]) == 4


def test_a_series_without_the_release_is_a_storage_error(tmp_path):
    write_series(tmp_path / "a.npz", {name: each for name, each in series_arrays().items() if name != "released_s"})
    with pytest.raises(StorageError, match=r"'a.npz' is damaged: .*released_s"):
        load_series(tmp_path / "a.npz", None)


@pytest.mark.parametrize(
    "link",
    [
        np.array([[ord("G"), 0], [ord("g"), 0], [ord("r"), 0]], dtype=np.uint8),
        np.array([[ord("G"), np.nan], [ord("g"), np.nan], [ord("r"), 0]]),
        np.array([["G", ""], ["g", ""], ["r", ""]]),
    ],
)
def test_a_series_says_when_the_release_was_and_which_signal_lies_ahead(tmp_path, link):
    rows = np.array([[0.1, np.nan], [0.2, 0.0], [0.3, 0.0]])
    written = series_arrays() | {"released_s": np.array(1.5), "lane_offset_m": rows, "link": link}
    write_series(tmp_path / "a.npz", written)
    series = load_series(tmp_path / "a.npz", None)
    assert series.released_s == 1.5
    assert series.lane_offset_m == [[0.1, None], [0.2, 0.0], [0.3, 0.0]]
    assert series.link == [["G", None], ["g", None], ["r", None]]


def test_a_lost_or_damaged_series_is_a_storage_error_not_a_crash(tmp_path):
    path = tmp_path / "a.npz"
    with pytest.raises(StorageError, match=r"'a\.npz' is gone"):
        load_series(path, None)
    write_series(path, series_arrays())
    whole = path.read_bytes()
    for size in range(0, len(whole), 97):
        path.write_bytes(whole[:size])
        with pytest.raises(StorageError, match="is damaged"):
            load_series(path, None)
    path.write_bytes(whole[:200] + bytes(byte ^ 0xFF for byte in whole[200:260]) + whole[260:])
    with pytest.raises(StorageError, match="is damaged"):
        load_series(path, None)


@pytest.mark.parametrize(
    "wrong",
    [{"time_s": np.zeros(2**25)}, {"kind": np.full(2, 99)}, {"x_m": np.zeros(3)}, {"signal": np.full(3, np.nan)}],
    ids=["too large", "unknown kind", "another shape", "no kind"],
)
def test_what_no_worker_writes_is_a_storage_error_not_a_crash(wrong, tmp_path):
    write_series(tmp_path / "a.npz", series_arrays() | wrong)
    with pytest.raises(StorageError, match=r"'a\.npz' is damaged"):
        load_series(tmp_path / "a.npz", None)


def test_a_series_that_is_not_the_one_that_was_written_is_never_shown(tmp_path):
    path = tmp_path / "a.npz"
    sha256 = write_series(path, series_arrays()).sha256
    assert load_series(path, sha256) == load_series(path, None)
    whole = path.read_bytes()
    for bit in range(0, 8 * len(whole), 8 * len(whole) // 60):
        path.write_bytes(whole[: bit // 8] + bytes([whole[bit // 8] ^ 1 << bit % 8]) + whole[bit // 8 + 1 :])
        with pytest.raises(StorageError, match=f"'a.npz' is damaged: its SHA-256 is [0-9a-f]{{64}}, wanted {sha256}"):
            load_series(path, sha256)
    write_series(path, series_arrays() | {"soft_min": np.ones(3)})  # undamaged, and another
    with pytest.raises(StorageError, match="damaged"):
        load_series(path, sha256)


def test_a_twin_is_told_with_its_series_and_its_contact_and_null_where_a_number_is_not_finite():
    speeds = {"ego_speed_mps": 12.3, "relative_speed_mps": 1.34}
    hit = collision(other_id="lead", **speeds, early_min_ttc_s=math.inf, judgement=judgement())
    body = json.loads(wire(twin_body("idle", twin_bytes(TwinPlay.of(None, hit, [hit]), series_arrays()))))
    assert (body["twin"], body["outcome"]) == ("idle", "touches lead at a closing speed of 1.3 m/s")
    assert body["collision"]["early_min_ttc_s"] is None
    assert body["collision"]["judgement"]["signature"] == hit.judgement.signature
    assert body["series"]["x_m"] == [[0.0, 1.0], [2.0, None], [4.0, 5.0]]
    assert body["series"]["robustness"] == [[1.0], [None], [-1.0]]


def test_what_is_not_told_of_a_series_is_left_out():
    series = series_arrays() | {"least_ttc_s": series_arrays()["soft_min"]}
    body = twin_body("careful", twin_bytes(TwinPlay.of(None, collision(), []), series))
    assert (body.outcome, body.collision) == ("no contact", None)
    assert "least_ttc_s" not in body.series.model_dump()
