import json
import os
import stat
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import BaseModel

from risk_sac.errors import DamagedError
from risk_sac.run_folder.durable import replace_file, seal, unseal


class Note(BaseModel):
    name: str = "ε"
    values: tuple[float | None, ...] = (1.5, None)
    sha256_of: dict[str, str] = {"sha256": "of something else"}


def test_sealed_text_is_json_with_one_more_field() -> None:
    assert json.loads(seal(Note())).keys() - Note.model_fields.keys() == {"sha256"}
    assert unseal(seal(Note()), Note) == Note()


@given(st.dictionaries(st.text(), st.integers() | st.text(), min_size=1))
def test_what_was_sealed_comes_back(value: dict[str, int | str]) -> None:
    assert unseal(seal(value), dict) == value


def test_every_flipped_bit_and_every_lost_end_is_noticed() -> None:
    sealed = seal(Note())
    damaged = [sealed[:length] for length in range(len(sealed))]
    damaged += [
        sealed[: bit // 8] + bytes([sealed[bit // 8] ^ 1 << bit % 8]) + sealed[bit // 8 + 1 :]
        for bit in range(8 * len(sealed))
    ]
    for content in damaged:
        with pytest.raises(DamagedError):
            unseal(content, Note)


def test_a_file_gets_its_mode_whatever_a_killed_writer_left(tmp_path: Path) -> None:
    file = tmp_path / "secret"
    (tmp_path / ".secret.tmp").write_text("left over")
    before = os.umask(0)
    try:
        replace_file(file, b"new", mode=0o600)
    finally:
        os.umask(before)
    assert (file.read_bytes(), stat.S_IMODE(file.stat().st_mode)) == (b"new", 0o600)
    assert [each.name for each in tmp_path.iterdir()] == ["secret"]
