"""Bytes of messages: literals by protoc, and whatever comes from outside."""

import contextlib
import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from risk_sac.egos.remote.wire import SCHEMA, decode, encode

OBSERVATION = {
    "session": "ä1",
    "time_s": 1.5,
    "actors": {"id": ["ego", "lead"], "kind": [0, 1], "x_m": [0.0, -2.5]},
    "signal": 3,
    "stop_line_m": math.inf,
}
# protoc --encode=risk_sac.egos.v2.Observation, of the same as text.
BY_PROTOC = bytes.fromhex(
    "0a03c3a43111000000000000f83f1a210a0365676f0a046c656164120200011a10000000000000000000000000000004c038034100000000"
    "0000f07f"
)


def test_a_message_is_what_protoc_makes_of_it():
    assert encode("Observation", OBSERVATION) == BY_PROTOC


def test_a_message_reads_back_with_nothing_where_nothing_was_told():
    read = decode("Observation", BY_PROTOC)
    assert {name: read[name] for name in ("session", "time_s", "signal", "stop_line_m")} == {
        name: OBSERVATION[name] for name in ("session", "time_s", "signal", "stop_line_m")
    }
    assert read["actors"]["x_m"] == [0.0, -2.5]
    assert read["actors"]["y_m"] == []
    assert read["speed_mps"] == 0.0
    assert "path" not in read


def test_what_a_later_version_adds_is_passed_over():
    added = bytes.fromhex("f8 07 96 01 fa 07 02 61 62 fd 07 00 00 00 00".replace(" ", ""))
    assert decode("StartReply", encode("StartReply", {"version": "1"}) + added) == {"version": "1"}


@settings(deadline=None, max_examples=300)
@given(st.sampled_from(sorted(SCHEMA)), st.binary(max_size=60))
def test_any_bytes_are_read_or_refused(name, data):
    with contextlib.suppress(ValueError):
        assert decode(name, data).keys() <= {field.name for field in SCHEMA[name]}


@pytest.mark.parametrize("seed", [0, 127, 128, 2**63, 2**64 - 1])
def test_numbers_of_any_size_read_back(seed):
    assert decode("StartRequest", encode("StartRequest", {"seed": seed}))["seed"] == seed
