import random

import pytest

from risk_sac.config import RunSpec
from risk_sac.errors import ConfigError
from risk_sac.run_folder.results import RESULTS, Results, read_results, write_results

SPEC = RunSpec(family="low", method="random", seed=0)


@pytest.fixture
def folder(tmp_path):
    write_results(tmp_path, Results(spec=SPEC, spec_digest=SPEC.digest, finished=False, wall_s=1.25))
    return tmp_path


def test_results_survive_the_round_trip(folder):
    assert read_results(folder) == Results(spec=SPEC, spec_digest=SPEC.digest, finished=False, wall_s=1.25)
    assert read_results(folder / RESULTS) == read_results(folder)


def test_no_flipped_bit_and_no_lost_end_is_read(folder):
    content = (folder / RESULTS).read_bytes()
    chance = random.Random(0)
    last = 8 * len(content)
    bits = [*chance.sample(range(last), 100), *range(last - 8 * 82, last)]  # the whole of the checksum's line too
    damaged = [
        content[: bit // 8] + bytes([content[bit // 8] ^ 1 << bit % 8]) + content[bit // 8 + 1 :] for bit in bits
    ]
    damaged += [content[:length] for length in chance.sample(range(len(content)), 100)]
    damaged += [content[:-length] for length in range(1, 90)]
    for case in damaged:
        (folder / RESULTS).write_bytes(case)
        with pytest.raises(ConfigError, match=r"results\.json is damaged"):
            read_results(folder)
