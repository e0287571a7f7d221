"""Why a worker is gone, as anybody may read it."""

from pathlib import Path

import pytest

from risk_sac.execution.postmortem import WorkerLog, without_folders


@pytest.mark.parametrize(
    ("said", "told"),
    [
        ('File "/opt/venv/lib/torch/nn.py", line 3, in f', 'File "nn.py", line 3, in f'),
        ("OSError: [Errno 28] No space left: '/srv/data/c1/run/a.json'", "OSError: [Errno 28] No space left: 'a.json'"),
        ("data/c1/run/results.json is damaged", "results.json is damaged"),
        ("folder 'data/c1/run' is in use", "folder 'run' is in use"),
        ("/data is full", "data is full"),
        ("4 m/s, 1 / 2 and https://a.example/b/c", "4 m/s, 1 / 2 and https://a.example/b/c"),
    ],
)
def test_a_text_keeps_the_names_of_files_and_no_folders(said: str, told: str) -> None:
    assert without_folders(said, Path("data/c1/run")) == told


def test_the_last_lines_of_a_log_are_told_without_folders(tmp_path: Path) -> None:
    log = tmp_path / "worker.log"
    log.write_text(f'an older worker\'s\nTraceback:\n  File "{log}", line 1\nValueError: no\n')
    assert (
        WorkerLog(log, len("an older worker's\n")).tail() == 'Traceback: | File "worker.log", line 1 | ValueError: no'
    )
