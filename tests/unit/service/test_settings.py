from pathlib import Path

from service.settings import ServiceSettings


def test_every_setting_has_a_default_and_one_worker_per_core(monkeypatch):
    monkeypatch.setattr("os.sched_getaffinity", lambda _: {0, 3, 5}, raising=False)
    settings = ServiceSettings()
    assert (settings.host, settings.port) == ("127.0.0.1", 8000)
    assert settings.max_workers == 3


def test_the_environment_overrides(monkeypatch):
    monkeypatch.setenv("RISK_SAC_DATA_DIR", "/srv/x")
    monkeypatch.setenv("RISK_SAC_MAX_WORKERS", "7")
    settings = ServiceSettings()
    assert settings.max_workers == 7
    assert settings.run_folder("c1", "low-sac-0") == Path("/srv/x/campaigns/c1/low-sac-0")
