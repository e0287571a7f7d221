import hashlib
import json
import logging
import os
import stat
from concurrent.futures import ThreadPoolExecutor

import pytest

from risk_sac.errors import ConfigError
from service.errors import KeysError
from service.keys import KeyFile, KeyRing, Scope, check_exposure
from service.keys.__main__ import main
from service.settings import ServiceSettings


@pytest.fixture
def file(tmp_path):
    return KeyFile(tmp_path / "data" / "keys.json")


@pytest.fixture
def ring(file):
    return KeyRing(file.path)


def test_of_a_key_only_the_hash_of_its_secret_is_kept(file):
    key, token = file.create("maps", "Ann", Scope.RUN)
    secret = token.removeprefix(f"rsk_{key.id}_")
    assert len(secret) == 43  # 256 bits in base64
    assert secret not in file.path.read_text()
    assert json.loads(file.path.read_text())["keys"][0]["hash"] == hashlib.sha256(secret.encode()).hexdigest()


def test_only_the_owner_may_read_the_file_whatever_the_umask(file):
    before = os.umask(0)
    try:
        key, _ = file.create("maps", "", Scope.READ)
        assert stat.S_IMODE(file.path.stat().st_mode) == 0o600
        file.revoke(key.id)
        assert stat.S_IMODE(file.path.stat().st_mode) == 0o600
    finally:
        os.umask(before)


def test_commands_at_the_same_time_lose_no_key(file):
    with ThreadPoolExecutor(8) as pool:
        made = list(pool.map(lambda n: file.create(f"p{n}", "", Scope.READ)[0], range(40)))
    assert sorted(key.id for key in file.read()) == sorted(key.id for key in made)


def test_what_a_killed_command_left_does_not_matter(file):
    key, _ = file.create("maps", "", Scope.READ)
    file.path.with_name(".keys.json.tmp").write_text('{"keys": [')
    assert file.read() == (key,)
    other, _ = file.create("maps", "", Scope.READ)
    assert file.read() == (key, other)


def test_a_damaged_file_is_never_written_over(file):
    file.create("maps", "", Scope.READ)
    file.path.write_text("{}")
    with pytest.raises(KeysError, match="damaged"):
        file.create("maps", "", Scope.READ)
    assert file.path.read_text() == "{}"


def test_ring_finds_a_key_by_its_token_only(file, ring):
    key, token = file.create("maps", "", Scope.READ)
    _, other = file.create("nets", "", Scope.READ)
    assert ring.find(token) == key
    mixed = f"rsk_{key.id}_{other[13:]}"
    last = token[:-1] + ("A" if token[-1] != "A" else "B")
    for wrong in ("", "rsk_", key.id, token[4:], token + "=", token.upper(), mixed, last, f"{token}\n", "ü" * 56):
        assert ring.find(wrong) is None, wrong


def test_ring_notices_new_and_revoked_keys_at_the_next_look(file, ring):
    assert ring.open
    for _ in range(20):
        key, token = file.create("maps", "", Scope.READ)
        assert ring.find(token) == key
        file.revoke(key.id)
        assert ring.find(token) is None


def test_ring_takes_a_damaged_file_never_for_an_empty_one(file, ring, caplog):
    _, token = file.create("maps", "", Scope.READ)
    whole = file.path.read_bytes()
    assert ring.find(token)
    for damaged in (b"", whole[:50], b'{"keys": [], "sha256": ""}', b"\xff\xfe"):
        file.path.write_bytes(damaged)
        for _ in range(3):
            with pytest.raises(KeysError):
                _ = ring.open
            with pytest.raises(KeysError):
                ring.find(token)
    assert len([record for record in caplog.records if record.levelno == logging.ERROR]) == 1, "said once"
    file.path.write_bytes(whole)
    assert ring.find(token)


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "192.168.1.7", "fe80::1", "example.org", "localhost.evil.org", ""])
def test_other_addresses_need_a_key_that_counts(tmp_path, host):
    settings = ServiceSettings(data_dir=tmp_path, host=host)
    file = KeyFile(settings.keys_file)
    with pytest.raises(ConfigError, match="wanted a loopback address, or API keys; create one with `risk-sac keys cr"):
        check_exposure(settings)
    key, _ = file.create("maps", "", Scope.READ)
    check_exposure(settings)
    file.revoke(key.id)
    with pytest.raises(ConfigError):
        check_exposure(settings)


def test_command_creates_lists_and_revokes(tmp_path, capsys):
    folder = ["--data-dir", str(tmp_path)]
    ring = KeyRing(tmp_path / "keys.json")
    assert main(["create", *folder, "--project", "maps", "--name", "Ann [b]", "--scope", "read"]) == 0
    token = capsys.readouterr().out.strip()
    key = ring.find(token)
    assert (key.project, key.name, key.scope) == ("maps", "Ann [b]", Scope.READ)
    assert main(["list", *folder]) == 0
    listed = capsys.readouterr().out
    assert key.id in listed
    assert "Ann [b]" in listed
    assert token[13:] not in listed
    assert main(["revoke", *folder, key.id]) == 0
    assert ring.find(token) is None
    assert main(["revoke", *folder, "nobody"]) == 1
    assert "wanted one that" in capsys.readouterr().err


def test_a_lost_file_opens_nothing_until_a_key_is_made(file, ring):
    with pytest.raises(KeysError):
        file.revoke("0" * 8)
    assert ring.open
    _, token = file.create("maps", "", Scope.RUN)
    file.path.unlink()
    for seen in (ring, KeyRing(file.path)):  # of a server that ran, and of one that starts
        with pytest.raises(KeysError, match="keys create"):
            seen.find(token)
        with pytest.raises(KeysError):
            _ = seen.open
    _, new = file.create("maps", "", Scope.RUN)
    assert ring.find(new) is not None
    assert ring.find(token) is None
    assert not ring.open


def test_a_file_that_is_replaced_is_never_missing_nor_open(file, ring):
    _, token = file.create("maps", "", Scope.RUN)
    with ThreadPoolExecutor(2) as pool:
        changes = [pool.submit(file.create, "maps", "", Scope.READ) for _ in range(100)]
        while not all(change.done() for change in changes):
            assert ring.find(token) is not None
            assert not ring.open
        for change in changes:
            change.result()
