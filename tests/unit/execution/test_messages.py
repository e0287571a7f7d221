import json
import math

import pytest
from pydantic import ValidationError

from risk_sac.execution.messages import Failed, Finished, Heartbeat, Started, decode, encode
from risk_sac.records import Outcome


def test_every_event_survives_the_wire(episode, metrics):
    finished = Finished(finished=True, metrics=metrics, evaluation=None, digest="d", versions={"sumo": "1"}, wall_s=1.5)
    contact = episode(1, Outcome.FAILURE).model_copy(update={"series_sha256": "0" * 64})
    for event in (Started(pid=3), Heartbeat(), contact, episode(0), finished, Failed(reason="no", storage=True)):
        assert decode(encode(event)).model_dump_json() == event.model_dump_json()  # a NaN is unequal to itself


def test_numbers_that_are_not_finite_survive_as_strict_json(episode):
    line = encode(episode(0, Outcome.FAILURE))

    def refuse(constant: str) -> None:
        raise AssertionError(constant)

    json.loads(line, parse_constant=refuse)
    record = decode(line).record
    assert record.min_ttc_s == math.inf
    assert math.isnan(record.collision.min_ttc_s)
    assert record.collision.min_robustness == -math.inf


@pytest.mark.parametrize(
    "line", [b"", b"\n", b"Loading net\n", b"{}", b'{"type":"started"}', b'{"type":"other"}', b"\xff\n", b"null"]
)
def test_what_is_no_event_is_refused(line):
    with pytest.raises(ValidationError):
        decode(line)


@pytest.mark.parametrize("name", ["../a.npz", "/etc/passwd", "a/b.npz", "", ".hidden", "a\x00b"])
def test_a_series_is_a_plain_file_name(episode, name):
    line = json.loads(encode(episode(0)))
    with pytest.raises(ValidationError, match="series"):
        decode(json.dumps(line | {"series": name}).encode())
