"""Bytes of messages: literals by protoc, and the generated stubs against their sources."""

import math
import subprocess
import sys
from pathlib import Path

import pytest

from risk_sac.egos.remote.ego_pb2 import Observation
from tests.server import ROOT

REMOTE = Path("risk_sac/egos/remote")
OBSERVATION = Observation(
    session="ä1",
    time_s=1.5,
    actors={"id": ["ego", "lead"], "kind": [0, 1], "x_m": [0.0, -2.5]},
    signal=3,
    stop_line_m=math.inf,
)
# protoc --encode=risk_sac.egos.v2.Observation, of the same as text.
BY_PROTOC = bytes.fromhex(
    "0a03c3a43111000000000000f83f1a210a0365676f0a046c656164120200011a10000000000000000000000000000004c038034100000000"
    "0000f07f"
)


def test_a_message_has_the_bytes_that_other_languages_read() -> None:
    assert OBSERVATION.SerializeToString() == BY_PROTOC
    assert Observation.FromString(BY_PROTOC) == OBSERVATION


@pytest.mark.parametrize("name", ["ego", "osi"])
def test_stubs_are_generated_from_their_sources(name: str, tmp_path: Path) -> None:
    command = [sys.executable, "-m", "grpc_tools.protoc", "-I.", f"--python_out={tmp_path}", REMOTE / f"{name}.proto"]
    subprocess.run(command, cwd=ROOT, check=True)
    stub = REMOTE / f"{name}_pb2.py"
    assert (tmp_path / stub).read_text() == (ROOT / stub).read_text(), "run `make protos`"
