import os

import pytest

from tests.exports.conftest import CHECKERS


def test_there_are_checkers() -> None:
    if not CHECKERS.exists() and "CI" not in os.environ:
        pytest.skip("OpenSCENARIO, OpenDRIVE and CommonRoad were not put before their checkers: `make checkers`")
    assert CHECKERS.exists()
