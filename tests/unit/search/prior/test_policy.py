"""Files of the pretrained policy."""

from dataclasses import replace

import numpy as np
import pytest

from risk_sac.errors import ConfigError
from risk_sac.search.prior.policy import POLICY, read_policy, shipped_policy, write_policy
from tests.builders import pretrained_policy


def test_a_file_gives_back_what_was_written(tmp_path):
    pretrained = pretrained_policy()
    write_policy(tmp_path / POLICY, pretrained)
    known = read_policy(tmp_path / POLICY)
    assert known.card == {"episodes": 12}
    for own, other in zip((*known.policy, *known.critics), (*pretrained.policy, *pretrained.critics), strict=True):
        np.testing.assert_array_equal(own, other)


@pytest.mark.parametrize("damage", ["cut", "text", "sizes", "nan", "temperature"])
def test_other_files_are_refused_in_one_line(tmp_path, damage):
    path, pretrained = tmp_path / POLICY, pretrained_policy()
    if damage == "sizes":
        pretrained = replace(pretrained, policy=(pretrained.policy[0][:, 1:], *pretrained.policy[1:]))
    if damage == "temperature":
        pretrained = replace(pretrained, temperature=0.0)
    if damage == "nan":
        pretrained.critics[0][:] = np.nan
    write_policy(path, pretrained)
    if damage == "cut":
        path.write_bytes(path.read_bytes()[:-100])
    if damage == "text":
        path.write_text("no arrays")
    with pytest.raises(ConfigError, match=r"^prior: .*policy.npz") as raised:
        read_policy(path)
    assert "\n" not in str(raised.value)


def test_the_shipped_policy_fits():
    assert shipped_policy().card["episodes"] >= 1000
