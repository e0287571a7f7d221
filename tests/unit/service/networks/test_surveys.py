from pathlib import Path

import pytest

from service.errors import StorageError
from service.networks import surveys
from service.networks.surveys import Surveys

SLEEPS = """
import time
open("begun", "w").close()
time.sleep(600)
"""


def test_a_search_ends_when_the_service_stops(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "surveyor.py").write_text(SLEEPS)
    monkeypatch.setattr(surveys, "SURVEYOR", str(tmp_path / "surveyor.py"))

    class Networks:
        def folder(self, network_id: str, project: str | None) -> Path:
            return tmp_path

    at_work = Surveys(Networks(), tmp_path / "places", (tmp_path / "begun").exists)  # type: ignore[arg-type]
    with pytest.raises(StorageError, match="places cannot be looked for"):
        at_work.places("n1", None)
