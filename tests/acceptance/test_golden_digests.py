"""Small runs come to the recorded digests unless results change on purpose."""

import pytest

from tests.acceptance.golden_digests import METHODS, SEEDS, digest, fingerprint, recorded

pytestmark = pytest.mark.torture  # they hold on one kind of processor; the suite compares a run with itself


@pytest.fixture(scope="module")
def digests() -> dict[str, str]:
    here = fingerprint()
    found = recorded(here)
    if found is None:
        pytest.skip(
            f"no digests were recorded for {' '.join(f'{name}={value}' for name, value in here.items())}; on a commit "
            "you trust, record them with `python -m tests.acceptance.golden_digests`"
        )
    return found


@pytest.mark.parametrize("family", SEEDS)
@pytest.mark.parametrize("method", METHODS)
def test_a_small_run_comes_to_the_recorded_digest(digests, family, method, tmp_path):
    assert digest(family, method, tmp_path) == digests[f"{family} {method}"]
