"""`risk_sac/failures/gate.md`: its commands print what it shows."""

import shutil
import sys
from pathlib import Path

import pytest

from tests.acceptance.readme import check, steps
from tests.openscenario_samples import FILES
from tests.server import ROOT

PAGE = ROOT / "risk_sac" / "failures" / "gate.md"


@pytest.mark.timeout(3600)
def test_commands_lead_from_an_openscenario_file_to_a_gate(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shutil.copytree(FILES, tmp_path / "files")
    tool = tmp_path / "bin" / "risk-sac"
    tool.parent.mkdir()
    tool.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m risk_sac "$@"\n')
    tool.chmod(0o755)
    monkeypatch.setenv("PATH", str(tool.parent), prepend=":")
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    monkeypatch.setenv("RISK_SAC_PLACES", str(tmp_path / "library"))
    check(tmp_path / "files", list(steps(PAGE.read_text(encoding="utf-8"))))
