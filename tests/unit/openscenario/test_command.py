"""`risk-sac scenarios import`; the gate page runs an OpenSCENARIO file itself."""

import json
from pathlib import Path

import pytest

from risk_sac import cli
from risk_sac.scenario import library
from risk_sac.scenario.reading import nets_of, read_document
from tests.openscenario_samples import SCENARIO, VARIATION, copied


@pytest.fixture(autouse=True)
def places(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(library.VARIABLE, str(tmp_path / "library"))


def test_a_document_is_written_with_its_roads_beside_it(tmp_path: Path) -> None:
    out = tmp_path / "out" / "mine.yaml"
    out.parent.mkdir()
    assert cli.main(["scenarios", "import", str(copied(tmp_path) / VARIATION), "--out", str(out)]) == 0
    assert sorted(file.name for file in out.parent.iterdir()) == ["mine.yaml", "road.net.xml", "road.xodr"]
    assert nets_of(read_document(out), out.parent)


def test_without_a_file_to_write_it_is_kept_by_name(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["scenarios", "import", str(copied(tmp_path) / SCENARIO), "--ego-entity", "Ego", "--json"]) == 0
    captured = capsys.readouterr()
    answer = json.loads(captured.out)
    (name,) = library.listed()
    assert name in answer["where"]
    assert "<AppearanceAction>" in captured.err
    document, folder = library.kept(name)
    assert (folder / "road.xodr").is_file()
    assert document.origin is not None


def test_a_fault_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = copied(tmp_path, (SCENARIO, 'entryName="adult"', 'entryName="adlt"')) / SCENARIO
    assert cli.main(["scenarios", "import", str(file)]) == 2
    assert "line 37, <CatalogReference>" in " ".join(capsys.readouterr().err.split())


def test_a_written_document_is_not_overwritten(tmp_path: Path) -> None:
    out = tmp_path / "mine.yaml"
    out.write_text("mine")
    assert cli.main(["scenarios", "import", str(copied(tmp_path) / SCENARIO), "--out", str(out)]) == 2
    assert out.read_text() == "mine"
