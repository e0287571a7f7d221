import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from risk_sac.errors import DamagedError
from risk_sac.run_folder.seal import seal, unseal

TEXT = json.dumps({"name": "ε", "values": [1.5, None], "inner": {"sha256": "of something else"}}, indent=2).encode()


def test_sealed_text_is_json_with_one_more_field():
    assert json.loads(seal(TEXT)).keys() - json.loads(TEXT).keys() == {"sha256"}
    assert unseal(seal(TEXT)) == TEXT


@given(st.dictionaries(st.text(), st.integers() | st.text(), min_size=1))
def test_what_was_sealed_comes_back(value):
    text = json.dumps(value, indent=2).encode()
    assert unseal(seal(text)) == text


def test_no_flipped_bit_and_no_lost_end_passes_for_the_text():
    sealed = seal(TEXT)
    lost = [sealed[:length] for length in range(len(sealed))]
    flips = [
        sealed[: bit // 8] + bytes([sealed[bit // 8] ^ 1 << bit % 8]) + sealed[bit // 8 + 1 :]
        for bit in range(8 * len(sealed))
    ]
    for damaged in lost + flips:
        try:
            text = unseal(damaged)
            fields = json.loads(text).keys()
        except (DamagedError, ValueError):
            continue
        assert fields != json.loads(TEXT).keys(), damaged  # its reader sees a field it does not know


def test_only_an_object_on_lines_of_its_own_can_be_sealed():
    for text in (b"{}", b"[\n]", b'{"a": 1}', b""):
        with pytest.raises(ValueError, match="wanted a JSON object"):
            seal(text)
