import os

import pytest

from tests.web.conftest import EXECUTABLE


def test_there_is_a_browser() -> None:
    if EXECUTABLE is None and "CI" not in os.environ:
        pytest.skip("the page was not tested: found no chromium; install it, or name one by RISK_SAC_CHROMIUM")
    assert EXECUTABLE is not None
