"""The library of users' scenarios."""

import os

import pytest

from risk_sac.errors import ConfigError, DamagedError
from risk_sac.maps.convert import present_net
from risk_sac.scenario import library
from risk_sac.scenario.families import FAMILIES, family_named
from risk_sac.scenario.reading import (
    FOLDER,
    PAPER_FAMILIES,
    document_from,
    networks,
    shipped_document,
    shipped_names,
    shipped_net,
)


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv(library.VARIABLE, str(tmp_path))
    return tmp_path


def kept_with_net(name: str) -> str:
    net = (FOLDER / name / f"{name}.net.xml").read_bytes()
    return library.keep(shipped_document(name).model_copy(update={"network": "net.xml"}), {"net.xml": net})


@pytest.mark.parametrize("name", PAPER_FAMILIES)
def test_written_documents_read_back_equal(name):
    document = shipped_document(name)
    assert document_from(library.written(document)) == document


@pytest.mark.parametrize("name", PAPER_FAMILIES)
def test_a_kept_scenario_is_a_family(name, folder):
    kept = kept_with_net(name)
    assert kept.startswith(f"{name}_")
    assert library.listed() == [kept]
    family, shipped = family_named(kept), FAMILIES[name]
    assert family.name == family.space.family == kept
    assert family.space.parameters == shipped.space.parameters
    middle = family.space.from_unit([0.5] * family.space.dimension).values
    assert family.layout(middle).ego == shipped.layout(middle).ego
    assert library.kept(kept) == (
        shipped_document(name).model_copy(update={"network": "net.xml"}),
        folder.absolute() / kept,
    )


def test_files_move_to_another_library(tmp_path, monkeypatch):
    kept = kept_with_net("low")
    files = library.files_of(kept)
    monkeypatch.setenv(library.VARIABLE, str(tmp_path / "another"))
    assert library.listed() == []
    library.put(kept, files)
    assert library.files_of(kept) == files


@pytest.mark.parametrize("changed", [{"net.xml": b"<net/>"}, {"../net.xml": b"<net/>"}, {library.DOCUMENT: b"name: a"}])
def test_files_that_are_not_those_of_the_name_are_refused(changed, folder):
    files = library.files_of(kept_with_net("low"))
    with pytest.raises(ConfigError):
        library.put("low_000000000000", {**files, **changed})
    assert not (folder / "low_000000000000").exists()


def test_a_net_that_leaves_the_folder_is_refused(folder):
    document = shipped_document("low").model_copy(update={"network": "../net.xml"})
    with pytest.raises(ConfigError) as refused:
        library.keep(document, {"../net.xml": b"<net/>"})
    assert refused.value.field == "network"
    assert list(folder.iterdir()) == []


def test_a_changed_scenario_is_refused_until_it_is_kept_again(folder):
    kept = kept_with_net("low")
    net = folder / kept / "net.xml"
    net.write_bytes(net.read_bytes().replace(b"3.30", b"3.40", 1))
    with pytest.raises(DamagedError):
        library.kept(kept)
    assert kept_with_net("low") == kept
    assert library.kept(kept)


@pytest.mark.parametrize("name", shipped_names())
def test_name_depends_on_no_comment_and_no_white_space(name, tmp_path):
    file = FOLDER / shipped_net(next(networks(shipped_document(name))))
    document = shipped_document(name).model_copy(update={"network": "net.xml"})
    again = file.read_bytes().replace(b"?>\n", b"?>\n<!-- generated on 2020-01-01 -->\n\n", 1)
    rewritten = present_net(file, tmp_path).file.read_bytes()  # as the service keeps it
    assert len({again, rewritten, file.read_bytes()}) == 3
    assert len({library.keep(document, {"net.xml": net}) for net in (file.read_bytes(), again, rewritten)}) == 1


def test_an_unknown_name_is_refused_with_the_known_ones():
    with pytest.raises(ConfigError) as refused:
        family_named("lwo")
    assert (refused.value.field, refused.value.remedy) == ("family", "did you mean low?")
    assert all(name in refused.value.expected for name in PAPER_FAMILIES)


def test_scenarios_without_a_campaign_go_when_they_are_old(folder):
    named, new, old = (library.keep(shipped_document(name), {}) for name in PAPER_FAMILIES)
    (folder / "of another program").mkdir()
    for path in (named, old, "of another program"):
        os.utime(folder / path, (0, 0))
    assert library.prune(folder, {named}, 3600.0, 0.0) == [old]
    assert {path.name for path in folder.iterdir()} == {named, new, "of another program"}
    os.utime(folder / new, (0, 0))
    assert library.keep(shipped_document("mixed"), {}) == new  # wanted again
    assert library.prune(folder, (), 3600.0, 0.0) == [named]
