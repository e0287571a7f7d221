from pathlib import Path

import numpy as np
import pytest

from risk_sac.errors import DamagedError
from risk_sac.run_folder.series import read_series, write_series


@pytest.mark.parametrize("damage", [lambda content: content[:-9], lambda content: b"", lambda content: b"no archive"])
def test_a_damaged_series_is_named(damage, tmp_path: Path) -> None:
    file = tmp_path / "000001.npz"
    write_series(file, {"x_m": np.arange(100.0)})
    np.testing.assert_array_equal(read_series(file)["x_m"], np.arange(100.0))
    file.write_bytes(damage(file.read_bytes()))
    with pytest.raises(DamagedError, match=r"000001\.npz is damaged"):
        read_series(file)
