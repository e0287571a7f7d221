import os
from pathlib import Path

import pytest

from risk_sac.failures import replay


@pytest.mark.parametrize(("killed", "status", "lines"), [(2, 0, 3), (99, 9, 0)])
def test_a_process_that_is_killed_is_replaced_but_not_for_ever(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, killed: int, status: int, lines: int
) -> None:
    tries = tmp_path / "tries"
    tries.mkdir()

    def tell(file: Path, runs: object) -> None:
        (tries / str(os.getpid())).touch()
        if len(list(tries.iterdir())) <= killed:
            os.kill(os.getpid(), 9)
        with file.open("ab", buffering=0) as output:
            output.write(b"{}\n")

    monkeypatch.setattr(replay, "_prepared", lambda file, folders: {})
    monkeypatch.setattr(replay, "_tell", tell)
    (tmp_path / "file").touch()
    assert replay._main(tmp_path / "file", 3, 1, []) == status
    assert len((tmp_path / "file").read_text().splitlines()) == lines
