"""`risk-sac scenarios` on files of a user's own."""

import pytest

from risk_sac import cli
from risk_sac.scenario import library
from risk_sac.scenario.reading import FOLDER, shipped_document

NET = FOLDER / "low/low.net.xml"


@pytest.fixture
def kept(tmp_path, monkeypatch):
    monkeypatch.setenv(library.VARIABLE, str(tmp_path / "library"))
    return library.keep(
        shipped_document("low").model_copy(update={"network": "net.xml"}), {"net.xml": NET.read_bytes()}
    )


def test_copy_writes_the_document_and_its_net_once(kept, tmp_path):
    assert cli.main(["scenarios", "copy", kept, str(tmp_path / "mine.yaml")]) == 0
    assert (tmp_path / "net.xml").read_bytes() == NET.read_bytes()
    assert cli.main(["scenarios", "copy", kept, str(tmp_path / "mine.yaml")]) == 2
    assert cli.main(["scenarios", "copy", kept, str(tmp_path / "other.yaml")]) == 0  # the net there is the same


def test_copy_overwrites_no_other_net(kept, tmp_path, capsys):
    (tmp_path / "net.xml").write_text("<net/>")
    assert cli.main(["scenarios", "copy", kept, str(tmp_path / "mine.yaml")]) == 2
    assert capsys.readouterr().err.startswith("file: ")
    assert (tmp_path / "net.xml").read_text() == "<net/>"
    assert not (tmp_path / "mine.yaml").exists()


def test_copy_into_a_missing_folder_is_refused(kept, tmp_path, capsys):
    assert cli.main(["scenarios", "copy", kept, str(tmp_path / "new/mine.yaml")]) == 2
    assert capsys.readouterr().err.startswith("file: ")


@pytest.mark.parametrize("name", ["low_00", "lwo"])
def test_show_suggests_a_name_that_is_kept_or_ships(kept, name, capsys):
    assert cli.main(["scenarios", "show", name]) == 2
    printed = capsys.readouterr().err
    assert printed.startswith("scenario: ")
    assert "did you mean low" in printed


def test_show_suggests_a_kept_name_by_the_document_s_own(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv(library.VARIABLE, str(tmp_path))
    name = library.keep(shipped_document("low").model_copy(update={"name": "bus"}), {})
    assert cli.main(["scenarios", "show", "bus"]) == 2
    assert f"did you mean {name}?" in capsys.readouterr().err


def test_check_suggests_the_whole_name_of_a_net_beside_the_document(kept, tmp_path, capsys):
    assert cli.main(["scenarios", "copy", "low", str(tmp_path / "mine.yaml")]) == 0
    document = (tmp_path / "mine.yaml").read_text().replace("network: low", "network: mine")
    (tmp_path / "mine.yaml").write_text(document)
    (tmp_path / "mine.net.xml").write_bytes(NET.read_bytes())
    capsys.readouterr()
    assert cli.main(["scenarios", "check", str(tmp_path / "mine.yaml")]) == 2
    assert "did you mean mine.net.xml?" in capsys.readouterr().err
