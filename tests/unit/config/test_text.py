"""Every reader of a user's text takes what editors and shells of all systems write."""

import argparse
import json
from collections.abc import Callable
from pathlib import Path

import pytest

from risk_sac.cli.campaigns.gate import Bounds
from risk_sac.cli.regress import read_baseline
from risk_sac.client.address import api_key
from risk_sac.config import EgoConfig
from risk_sac.config.spec_file import read_campaign, read_ego, read_spec
from risk_sac.egos.registry import card_of
from risk_sac.errors import ConfigError
from risk_sac.failures.cases import Regression

SPEC = "label: Straße\nfamilies: [low]\nmethods: [random]\nlearner: {agent: {actor_learning_rate: 1.0e-7}}\n"
JSON = '{\n\t"families": ["low"],\n\t"learner": {"agent": {"actor_learning_rate": 1e-7}}\n}\n'
KNOWN = json.dumps({"campaign_id": "c", "state": "succeeded", "complete": True, "runs": [], "totals": []})
EGOS = '[far]\naddress = "127.0.0.1:9"\nversion = "ä"\nresponse_time_s = 0.3\n'


def read_known(file: Path) -> object:
    names = ("max_ecr", "max_pcr", "max_preventable", "max_rate")
    return Bounds.of(argparse.Namespace(**dict.fromkeys(names), no_new_failures=file, judge_by="rate")).known


def read_egos(file: Path) -> object:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("RISK_SAC_EGOS", str(file))
        return card_of("far")


READERS: dict[str, tuple[str, Callable[[Path], object]]] = {
    "campaign": (SPEC, lambda file: read_campaign(file, {}, {})),
    "campaign as JSON": (JSON, lambda file: read_campaign(file, {}, {})),
    "run": (SPEC, lambda file: read_spec(file, {})),
    "ego": ("profile: perfect # für\n", lambda file: read_ego(str(file))),
    "gate": (KNOWN, read_known),
    "baseline": (Regression(ego=EgoConfig(), cases=()).model_dump_json(), read_baseline),
    "key": ("a-key\n", lambda file: api_key({"RISK_SAC_API_KEY_FILE": str(file)})),
    "egos": (EGOS, read_egos),
}


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "utf-32"])
@pytest.mark.parametrize("name", READERS)
def test_a_byte_order_mark_and_other_ends_of_lines_change_nothing(name: str, encoding: str, tmp_path: Path) -> None:
    text, read = READERS[name]
    plain, marked = tmp_path / "plain.yaml", tmp_path / "marked.yaml"
    plain.write_text(text, encoding="utf-8")
    for ends in ("\r\n", "\r"):
        marked.write_bytes(text.replace("\n", ends).encode(encoding))
        assert read(marked) == read(plain)


@pytest.mark.parametrize("name", READERS)
def test_another_encoding_is_one_line_that_says_what_to_do(name: str, tmp_path: Path) -> None:
    file = tmp_path / "latin.yaml"
    file.write_bytes("label: Straße\n".encode("latin-1"))
    with pytest.raises(
        ConfigError, match=r"latin\.yaml, which is no UTF-8 from byte 11 on; wanted a text file; save it as UTF-8"
    ):
        READERS[name][1](file)
