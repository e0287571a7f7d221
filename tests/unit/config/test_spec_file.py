"""Spec files, encodings and flags, and the i.i.d. phase's runs."""

import argparse
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from pydantic import ValidationError

from risk_sac.cli.campaigns.gate import GateBounds
from risk_sac.cli.regress import read_baseline
from risk_sac.client.transport import api_key
from risk_sac.config import Budget, CampaignSpec, EgoConfig, Interval
from risk_sac.config.spec_file import campaign_yaml, read_campaign, read_ego, read_spec
from risk_sac.egos.registry import card_of
from risk_sac.errors import ConfigError
from risk_sac.failures.studied import Regression
from risk_sac.host.machine import cores

FLAGS: dict[str, Any] = dict.fromkeys(("family", "method", "seed", "episodes", "evaluation_episodes"))


def yaml_file(folder: Path, text: str) -> Path:
    file = folder / "spec.yaml"
    file.write_text(text)
    return file


@pytest.mark.parametrize(
    ("text", "field"),
    [
        ("method: sac\nseed: 0", "family"),
        ("family: High\nmethod: sac\nseed: 0", "family"),
        ("family: low\nmethod: sac\nseed: '3'", "seed"),
        ("family: low\nmethod: sac\nseed: 0\nbudget: {episodes: .nan}", "budget.episodes"),
        ("family: low\nrequirements: [{name: a, formula: x, scale: -1}]", "requirements[0].scale"),
        ("family: low\njudge: {drivers: [r157, fms]}", "judge.drivers[1]"),
        ("families: [low, low]", "families"),
        ("[1, 2]", "spec"),
        ("family: [", "spec"),
        ("family: low\nbuget: {episodes: 5}", "buget"),
        ("family: 2020-01-01\nmethod: sac\nseed: 0", "family"),
    ],
)
def test_wrong_file_names_the_field(tmp_path, text, field):
    with pytest.raises(ConfigError) as raised:
        read_spec(yaml_file(tmp_path, text), FLAGS)
    assert raised.value.field == field


CAMPAIGN_FLAGS: dict[str, Any] = dict.fromkeys(("families", "methods", "seeds", "episodes", "evaluation_episodes"))
DEFAULTS: dict[str, Any] = {"families": ["low"], "methods": ["sac"], "seeds": [0, 1]}


def test_campaign_written_as_yaml_is_the_same_campaign(tmp_path):
    text = "label: 'a: b'\nego: {profile: perfect}\nlearner: {lagrangian: {learning_rate: 1.0e-7}}\n"
    text += "odd: {environment: {friction: {low: 0.5, high: 0.7}}}\n"
    text += "requirements: [{name: slow, formula: ego_speed_mps < 5, scale: 1.0}]\n"
    spec = read_campaign(yaml_file(tmp_path, text), CAMPAIGN_FLAGS, DEFAULTS)
    again = read_campaign(yaml_file(tmp_path, campaign_yaml(spec)), CAMPAIGN_FLAGS, {})
    assert again == spec
    assert again.digest == spec.digest
    assert read_campaign(None, CAMPAIGN_FLAGS, DEFAULTS).digest != spec.digest


ENDS = {"families": ["low", "dense"], "methods": ["random", "archive"], "seeds": [0, 7], "iid": {"seed": 7}}


def test_no_generator_of_it_is_seeded_as_one_of_a_search_or_of_another_of_its_runs():
    spec = CampaignSpec.model_validate(ENDS)
    streams = [run.stream for run in spec.drawn()]
    assert len(set(streams)) == 4
    assert min(streams) > 2**31 - 1  # the largest seed that can be posted
    assert all(run.stream == run.seed for run in spec.searches())


def test_nobody_posts_its_runs_as_methods_nor_more_episodes_than_a_campaign_may_have():
    with pytest.raises(ValidationError, match="iid-random"):
        CampaignSpec.model_validate({"families": ["low"], "methods": ["iid-random"]})
    with pytest.raises(ValidationError, match="episodes"):
        CampaignSpec.model_validate({"families": ["low"], "iid": {"episodes": 0}})
    full = {"families": ["low"], "seeds": list(range(20)), "budget": {"episodes": 100_000}}
    assert CampaignSpec.model_validate(full)
    with pytest.raises(ValidationError, match=r"and 600 of the i\.i\.d\. phase; wanted at most 2000000"):
        CampaignSpec.model_validate(full | {"iid": {}})


SPEC = "label: Straße\nfamilies: [low]\nmethods: [random]\nlearner: {agent: {actor_learning_rate: 1.0e-7}}\n"
JSON = '{\n\t"families": ["low"],\n\t"learner": {"agent": {"actor_learning_rate": 1e-7}}\n}\n'
KNOWN = json.dumps({"campaign_id": "c", "state": "succeeded", "complete": True, "runs": [], "totals": []})
EGOS = '[far]\naddress = "127.0.0.1:9"\nversion = "ä"\nresponse_time_s = 0.3\n'


def read_known(file: Path) -> object:
    names = ("max_ecr", "max_pcr", "max_preventable", "max_rate")
    return GateBounds.of(argparse.Namespace(**dict.fromkeys(names), no_new_failures=file, judge_by="rate")).known


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
def test_a_byte_order_mark_and_other_ends_of_lines_change_nothing(name, encoding, tmp_path):
    text, read = READERS[name]
    plain, marked = tmp_path / "plain.yaml", tmp_path / "marked.yaml"
    plain.write_text(text, encoding="utf-8")
    for ends in ("\r\n", "\r"):
        marked.write_bytes(text.replace("\n", ends).encode(encoding))
        assert read(marked) == read(plain)


@pytest.mark.parametrize("name", READERS)
def test_another_encoding_is_one_line_that_says_what_to_do(name, tmp_path):
    file = tmp_path / "latin.yaml"
    file.write_bytes("label: Straße\n".encode("latin-1"))
    with pytest.raises(
        ConfigError, match=r"latin\.yaml, which is no UTF-8 from byte 11 on; wanted a text file; save it as UTF-8"
    ):
        READERS[name][1](file)


def test_the_behaviour_of_a_flag_goes_into_the_odd_beside_what_a_file_states(tmp_path):
    text = "family: low\nodd: {dynamic: {vehicle_jerk_mps3: {low: 0, high: 5}, behaviour: extreme}}\n"
    dynamic = read_spec(yaml_file(tmp_path, text), {"behaviour": "emergency"}).odd.dynamic
    assert (dynamic.behaviour, dynamic.vehicle_jerk_mps3) == ("emergency", Interval(low=0, high=5))
    assert read_spec(None, {"family": "low"}).odd.dynamic.behaviour == "ordinary"


def test_an_unknown_behaviour_is_refused_by_its_field():
    with pytest.raises(ConfigError) as refused:
        read_spec(None, {"family": "low", "behaviour": "wild"})
    assert refused.value.field == "odd.dynamic.behaviour"
    assert "'ordinary', 'emergency' or 'extreme'" in str(refused.value)


def test_a_batch_of_auto_is_two_episodes_for_each_processor_and_is_written_as_that_number():
    budget = Budget.model_validate({"batch": "auto"})
    assert budget.batch == 2 * cores()
    assert Budget.model_validate_json(budget.model_dump_json()) == budget
