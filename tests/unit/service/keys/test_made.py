"""Keys that were made once, and whose file is lost."""

from concurrent.futures import ThreadPoolExecutor

import pytest

from service.errors import KeysError
from service.keys.__main__ import main
from service.keys.file import KeyFile, Scope
from service.keys.made import AuthEnabledFlag, ever_made
from service.keys.ring import KeyRing
from service.settings import ServiceSettings
from service.store.database import keys_were_made
from service.store.reading import Store

CREATE = ["create", "--project", "maps"]


@pytest.fixture
def settings(tmp_path, database_url, monkeypatch):
    """Of a service that has not started yet, with each kind of database."""
    monkeypatch.setenv("RISK_SAC_DATA_DIR", str(tmp_path / "data"))
    monkeypatch.setenv("RISK_SAC_DATABASE_URL", database_url)
    return ServiceSettings()


@pytest.fixture
def file(settings):
    return KeyFile(settings.keys_file)


@pytest.fixture
def store(settings):
    store = Store(settings.url)
    yield store
    store.close()


def test_the_command_notes_in_the_database_that_there_are_keys(settings, file):
    assert not ever_made(settings)
    assert main(CREATE) == 0
    assert ever_made(settings)
    file.path.unlink()
    assert ever_made(settings)
    store = Store(settings.url)  # which is the server's, and is as the server would have made it
    assert keys_were_made(store.engine)
    store.close()


def test_the_command_takes_lost_keys_for_lost(settings, file, capsys):
    assert main(["list"]) == 0
    assert main(CREATE) == 0
    (old,) = file.read()
    for damage in (file.path.unlink, lambda: file.path.write_text("{}")):
        damage()
        capsys.readouterr()
        for command in (["list"], CREATE, ["revoke", old.id]):
            assert main(command) == 1
            assert "make a new one by `risk-sac keys create --replace-file`" in capsys.readouterr().err
        assert main([*CREATE, "--replace-file"]) == 0
        (new,) = file.read()
        assert new.id != old.id
    assert main([*CREATE, "--replace-file"]) == 1
    assert "is intact" in capsys.readouterr().err
    assert file.read() == (new,)


def test_a_server_notes_keys_that_it_sees_and_heeds_what_is_noted(file, store, caplog):
    _, token = file.create("maps", "", Scope.RUN)
    AuthEnabledFlag().settle(store.engine, file)
    assert keys_were_made(store.engine)
    file.path.unlink()
    made = AuthEnabledFlag()
    made.settle(store.engine, file)
    ring = KeyRing(file.path, made)
    for _ in range(3):
        with pytest.raises(KeysError, match=r"is missing, although keys were made; restore .* create --replace-file`"):
            ring.find(token)
        with pytest.raises(KeysError, match="missing"):
            _ = ring.open
    _, new = file.replace("maps", "", Scope.RUN)
    assert ring.find(new) is not None
    assert ring.find(token) is None
    assert not ring.open
    assert caplog.text.count("missing, although") == 1, "said once"


def test_a_file_that_is_replaced_is_never_missing_nor_open(file):
    made = AuthEnabledFlag()
    ring = KeyRing(file.path, made)
    _, token = file.create("maps", "", Scope.RUN)
    with ThreadPoolExecutor(2) as pool:
        changes = [pool.submit(file.create, "maps", "", Scope.READ) for _ in range(100)]
        while not all(change.done() for change in changes):
            assert ring.find(token) is not None
            assert not ring.open
        for change in changes:
            change.result()


def test_the_first_key_is_never_missing(settings, file, store):
    made = AuthEnabledFlag()
    with ThreadPoolExecutor(1) as pool:
        ring = KeyRing(file.path, made)
        change = pool.submit(main, CREATE)
        seen = [ring.open]
        while not (change.done() and made.known):
            made.settle(store.engine, file)
            seen.append(ring.open)  # raises where it takes the file for missing
        assert change.result() == 0
    assert sorted(seen, reverse=True) == seen, "open until there is a key, and never again"
    assert not ring.open
