"""Stub of road conversions for tests that are about something else."""

import pytest

from risk_sac.openscenario import scenario_file


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Makes an empty net of each road."""
    monkeypatch.setattr(scenario_file, "_net", lambda *_: b"<net/>")
