from pathlib import Path

from risk_sac.config import RunSpec
from risk_sac.execution.ray.beside import beside

NODE = Path("/node/beside")
LOW = RunSpec(family="low", method="random", seed=1)


def test_a_shipped_family_takes_the_files_that_its_arguments_name(monkeypatch, tmp_path):
    monkeypatch.delenv("RISK_SAC_EGOS", raising=False)
    taken = beside(LOW, (tmp_path / "spec.yaml",), NODE)
    assert taken.files == {"spec.yaml": str(tmp_path / "spec.yaml")}
    assert taken.environment == {"RISK_SAC_EGOS": ""}, "what a node registers by itself does not count"


def test_registered_egos_and_the_place_of_a_map_come_along(monkeypatch, tmp_path):
    monkeypatch.setenv("RISK_SAC_EGOS", str(tmp_path / "mine.toml"))
    monkeypatch.setenv("RISK_SAC_PLACES", str(tmp_path / "places"))
    name = "crossing_0123456789ab"
    taken = beside(LOW.model_copy(update={"family": name}), (), NODE)
    assert taken.files == {"egos.toml": str(tmp_path / "mine.toml"), f"places/{name}": str(tmp_path / "places" / name)}
    assert taken.environment == {"RISK_SAC_EGOS": "/node/beside/egos.toml", "RISK_SAC_PLACES": "/node/beside/places"}
