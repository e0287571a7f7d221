"""Wrong settings, as an operator of the service's programs sees them."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

RISK_SAC = [sys.executable, "-c", "import sys; from risk_sac.cli import main; sys.exit(main())"]
PROGRAMS = {
    "service": [sys.executable, "-m", "service"],
    "serve": [*RISK_SAC, "serve"],
    "keys": [*RISK_SAC, "keys", "list"],
    "database": [sys.executable, "-m", "service.store", "back"],
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
