from collections.abc import Iterator

import pytest
from hypothesis import settings

from tests.postgresql import PostgreSql, binaries, running

# The first example pays for torch's lazy imports and for compilation, whichever it is.
settings.register_profile("first call may compile", deadline=None)
settings.load_profile("first call may compile")


@pytest.fixture(scope="session")
def postgresql() -> Iterator[PostgreSql]:
    """A PostgreSQL server; tests that need one are skipped where it is not installed."""
    bin_ = binaries()
    if bin_ is None:
        pytest.skip("PostgreSQL is not installed")
    with running(bin_) as server:
        yield server
