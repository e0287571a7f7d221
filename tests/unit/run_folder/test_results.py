import pytest

from risk_sac.config import RunSpec
from risk_sac.errors import ConfigError
from risk_sac.run_folder.results import RESULTS, Results, read_results, write_results

SPEC = RunSpec(family="low", method="random", seed=0)


@pytest.fixture
def folder(tmp_path):
    write_results(tmp_path, Results(spec=SPEC, spec_digest=SPEC.digest, finished=False, wall_s=1.25))
    return tmp_path


def test_damaged_results_are_named(folder):
    content = (folder / RESULTS).read_bytes()
    for damaged in (b"", content[:-1], content.replace(b'"low"', b'"lou"')):
        (folder / RESULTS).write_bytes(damaged)
        with pytest.raises(ConfigError, match=r"results\.json is damaged"):
            read_results(folder)
