"""Wrong settings, as an operator of the service's programs sees them."""

import json
import logging
import os
import stat
import subprocess
import sys
import time
from datetime import datetime, timedelta
from pathlib import Path

import pytest

from risk_sac.host.terminal import LogFormatter
from service.errors import StorageError
from service.host import TextFormatter, hold_data_folder, json_formatter, make_private
from service.store.reading import Store


@pytest.fixture(autouse=True)
def _generous():
    """What is made is for everybody, unless its maker says otherwise."""
    before = os.umask(0)
    yield
    os.umask(before)


def mode(path: Path) -> int:
    return stat.S_IMODE(path.stat().st_mode)


def test_a_new_data_folder_is_nobody_elses(tmp_path):
    hold_data_folder(tmp_path / "new" / "data").close()
    assert mode(tmp_path / "new" / "data") == 0o700


def test_a_folder_that_others_need_is_refused_and_stays_as_it_is(tmp_path):
    folder = tmp_path / "lib"
    (folder / "of-another-program").mkdir(parents=True, mode=0o755)
    folder.chmod(0o755)
    with pytest.raises(StorageError, match=r"others may look into \(mode 0755\).* wanted a folder of its own"):
        hold_data_folder(folder)
    assert mode(folder) == 0o755
    folder.chmod(0o700)
    hold_data_folder(folder).close()


def test_what_is_not_ours_to_change_is_refused_where_everybody_may_look(tmp_path, monkeypatch):
    def refuse(path, mode):
        raise PermissionError(1, "Operation not permitted", str(path))

    monkeypatch.setattr(Path, "chmod", refuse)
    folder, file = tmp_path / "data", tmp_path / "file"
    folder.mkdir(mode=0o775)
    os.close(os.open(file, os.O_CREAT, 0o644))
    with pytest.raises(StorageError, match=r"data' has mode 0775, .*\(Operation not permitted\); wanted 0700"):
        make_private(folder)
    with pytest.raises(StorageError, match=r"file' has mode 0644, .*; wanted 0600"):
        make_private(file)
    os.chmod(folder, 0o770)  # a volume that its owner lends to a group
    make_private(folder)
    assert mode(folder) == 0o770


def test_only_the_owner_may_read_the_database_and_its_journal(tmp_path):
    store = Store(f"sqlite:///{tmp_path}/risk-sac.db")
    store.campaigns(limit=1)
    files = sorted(tmp_path.glob("risk-sac.db*"))
    assert [path.name for path in files] == ["risk-sac.db", "risk-sac.db-shm", "risk-sac.db-wal"]
    assert {path.name: mode(path) for path in files} == {path.name: 0o600 for path in files}
    store.close()


RISK_SAC = [sys.executable, "-c", "import sys; from risk_sac.cli import main; sys.exit(main())"]
PROGRAMS = {
    "service": [sys.executable, "-m", "service"],
    "serve": [*RISK_SAC, "serve"],
    "keys": [*RISK_SAC, "keys", "list"],
    "database": [sys.executable, "-m", "service.store", "copy", "copy.db"],
}


def start(program: str, folder: Path, **settings: str) -> subprocess.CompletedProcess[str]:
    given = {f"RISK_SAC_{name.upper()}": value for name, value in ({"data_dir": str(folder)} | settings).items()}
    return subprocess.run(
        PROGRAMS[program], env=os.environ | given, capture_output=True, text=True, timeout=600, check=False
    )


@pytest.mark.parametrize("program", PROGRAMS)
def test_each_wrong_setting_is_one_line_and_the_exit_status_is_2(program, tmp_path):
    wrong = {"port": "http", "grace_s": "nan", "log_format": "xml", "cors_origins": "*", "allowed_hosts": "[1]"}
    ended = start(program, tmp_path, **wrong)
    assert (ended.returncode, ended.stdout) == (2, "")
    assert ended.stderr.splitlines() == [
        "RISK_SAC_PORT: got 'http'; wanted integer ≥ 1, ≤ 65535",
        "RISK_SAC_LOG_FORMAT: got 'xml'; wanted `text` or `json`",
        "RISK_SAC_GRACE_S: got 'nan'; wanted number > 0, ≤ 600",
        "RISK_SAC_ALLOWED_HOSTS: got 1; wanted text",
        "RISK_SAC_CORS_ORIGINS: got '*'; wanted JSON list",
    ]
    assert list(tmp_path.iterdir()) == []


def record(message, exc_info=None, **extra):
    return logging.getLogger("service.runs.manager").makeRecord(
        "service.runs.manager", logging.INFO, __file__, 1, message, (), exc_info, extra=extra
    )


@pytest.mark.parametrize(
    ("extra", "end"),
    [
        ({}, "service.runs.manager: process 7"),
        ({"campaign": "c1"}, "process 7 [campaign c1]"),
        ({"campaign": "c1", "run": "low-sac-0"}, "process 7 [campaign c1, run low-sac-0]"),
        ({"campaign": None, "ms": 3}, "process 7"),
    ],
)
def test_a_line_ends_with_what_it_is_about(extra, end):
    assert TextFormatter().format(record("process 7", **extra)).endswith(end)


@pytest.mark.parametrize("zone", ["UTC", "Asia/Tokyo", "America/St_Johns"])
def test_a_line_begins_with_its_time_in_utc_wherever_the_machine_is(monkeypatch, zone):
    monkeypatch.setenv("TZ", zone)
    time.tzset()
    told = record("process 7")
    for line in (TextFormatter().format(told), LogFormatter().format(told)):
        shown = datetime.fromisoformat(line.partition(" ")[0])
        assert shown.utcoffset() == timedelta(0)
        assert abs(shown.timestamp() - told.created) < 0.002
    monkeypatch.undo()
    time.tzset()


def test_a_json_line_has_what_a_search_needs_and_no_colours():
    line = json_formatter().format(record("process 7", campaign="c1", run="low-sac-0", color_message="\x1b[36m7"))
    fields = json.loads(line)
    assert datetime.fromisoformat(fields.pop("time")).utcoffset() == timedelta(0)
    assert fields == {
        "level": "INFO",
        "logger": "service.runs.manager",
        "message": "process 7",
        "campaign": "c1",
        "run": "low-sac-0",
    }


def test_a_traceback_stays_on_its_json_line():
    try:
        raise ValueError("wrong\nline")
    except ValueError:
        line = json_formatter().format(record("a bug", exc_info=sys.exc_info()))
    assert "\n" not in line
    assert "ValueError: wrong\nline" in json.loads(line)["exc_info"]
