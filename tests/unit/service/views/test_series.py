import numpy as np
import pytest

from risk_sac.run_folder.series import write_series
from service.errors import StorageError
from service.views.series import load_series
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
