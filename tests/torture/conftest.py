"""Counts of faults: full with RISK_SAC_TORTURE=full (`make torture`), else a few.

The suite itself uploads a part of the hostile files, and leaves all that is marked `torture` alone.
"""

import os
from collections.abc import Callable, Iterator
from pathlib import Path
from random import Random

import pytest

from tests.server import Service, servers

FULL = os.environ.get("RISK_SAC_TORTURE") == "full"


@pytest.fixture(scope="session")
def times() -> Callable[[int, int], int]:
    """How often to do something: seldom, or often in earnest."""
    return lambda seldom, often: often if FULL else seldom


@pytest.fixture
def chance(request: pytest.FixtureRequest) -> Random:
    """Random moments; another seed in RISK_SAC_TORTURE_SEED gives others."""
    return Random(f"{os.environ.get('RISK_SAC_TORTURE_SEED', 0)} {request.node.name}")


@pytest.fixture
def serve(tmp_path: Path) -> Iterator[Callable[..., Service]]:
    """Starts servers and stops them at the end of the test."""
    with servers(tmp_path) as start:
        yield start


@pytest.fixture
def tell(capsys: pytest.CaptureFixture[str]) -> Callable[[str], None]:
    """Prints what was done, in earnest."""

    def line(text: str) -> None:
        if FULL:
            with capsys.disabled():
                print(f"\n  {text}", flush=True)

    return line
