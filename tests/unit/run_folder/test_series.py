import io
import zipfile
from pathlib import Path

import numpy as np
import pytest

from risk_sac.errors import DamagedError
from risk_sac.run_folder.arrays import MOST_BYTES, MOST_VALUES, read_series
from risk_sac.run_folder.series import pack_series, write_series


@pytest.mark.parametrize("damage", [lambda content: content[:-9], lambda content: b"", lambda content: b"no archive"])
def test_a_damaged_series_is_named(damage, tmp_path: Path) -> None:
    file = tmp_path / "000001.npz"
    write_series(file, pack_series({"x_m": np.arange(100.0)}))
    np.testing.assert_array_equal(read_series(file)["x_m"], np.arange(100.0))
    file.write_bytes(damage(file.read_bytes()))
    with pytest.raises(DamagedError, match=r"000001\.npz is damaged"):
        read_series(file)


def without_letters(count: int) -> bytes:
    """Packs `count` texts of no letters, which take no bytes of file."""
    array, file = io.BytesIO(), io.BytesIO()
    header = {"descr": "<U0", "fortran_order": False, "shape": (count,)}
    np.lib.format.write_array_header_1_0(array, header)
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("ids.npy", array.getvalue())
    return file.getvalue()


def packed(array: np.ndarray) -> bytes:
    file = io.BytesIO()
    np.savez_compressed(file, x_m=array)
    return file.getvalue()


@pytest.mark.parametrize(
    ("content", "complaint"),
    [
        (lambda: packed(np.zeros(MOST_BYTES // 8)), "arrays of [0-9]+ bytes; wanted at most"),
        (lambda: packed(np.zeros(MOST_VALUES + 1, dtype=np.int8)), f"{MOST_VALUES + 1} values; wanted at most"),
        (lambda: without_letters(MOST_VALUES + 1), f"{MOST_VALUES + 1} values; wanted at most"),
        (lambda: packed(np.zeros(9, dtype=[(f"f{i}", "<f8") for i in range(99)])), "wanted numbers or text"),
        (lambda: bytes(MOST_BYTES + 1), "is larger than"),
    ],
    ids=["bytes", "values", "values of no bytes", "values in values", "file"],
)
def test_a_series_that_unpacks_into_more_than_any_run_records_is_refused(content, complaint, tmp_path: Path) -> None:
    file = tmp_path / "000001.npz"
    file.write_bytes(content())
    with pytest.raises(DamagedError, match=complaint):
        read_series(file)
