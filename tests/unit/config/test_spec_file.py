from pathlib import Path
from typing import Any

import pytest

from risk_sac.config.spec_file import campaign_yaml, read_campaign, read_spec
from risk_sac.errors import ConfigError

FLAGS: dict[str, Any] = dict.fromkeys(("family", "method", "seed", "episodes", "evaluation_episodes"))


def yaml_file(folder: Path, text: str) -> Path:
    file = folder / "spec.yaml"
    file.write_text(text)
    return file


def test_run_file_keeps_its_fields_and_flags_override_them(tmp_path: Path) -> None:
    file = yaml_file(
        tmp_path,
        "family: mixed\nmethod: sac\nseed: 4\nbudget: {episodes: 9, evaluation_episodes: 2}\n"
        "ego: {profile: perfect}\nrequirements: [{name: slow, formula: ego_speed_mps < 5, scale: 1.0}]\n",
    )
    spec = read_spec(file, FLAGS | {"seed": 5, "episodes": 3})
    assert (spec.family, spec.method, spec.seed) == ("mixed", "sac", 5)
    assert (spec.budget.episodes, spec.budget.evaluation_episodes) == (3, 2)
    assert spec.ego.sensor is None
    assert spec.requirements[0].name == "slow"


def test_flags_pick_one_run_of_a_campaign(tmp_path: Path) -> None:
    file = yaml_file(tmp_path, "label: all\nfamilies: [low, mixed]\nmethods: [random, sac]\nseeds: [1, 2]\n")
    with pytest.raises(ConfigError, match="got a campaign of 8 runs; wanted one") as raised:
        read_spec(file, FLAGS)
    assert raised.value.field == "spec"
    picked = read_spec(file, FLAGS | {"family": "mixed", "method": "sac", "seed": 2})
    assert (picked.family, picked.method, picked.seed) == ("mixed", "sac", 2)


@pytest.mark.parametrize(
    ("text", "field", "message"),
    [
        ("method: sac\nseed: 0", "family", "got nothing; wanted a value"),
        ("family: high\nmethod: sac\nseed: 0", "family", "got \"high\"; wanted 'low', 'mixed'"),
        ("family: low\nmethod: sac\nseed: '3'", "seed", 'got "3"; wanted an integer'),
        ("family: low\nmethod: sac\nseed: 0\nbudget: {episodes: .nan}", "budget.episodes", "NaN"),
        ("family: low\nmethod: sac\nseed: 0\nbudgets: {}", "budgets", "wanted one of budget, ego"),
        ("family: low\nmethod: sac\nseed: 0\nbudget: 3", "budget", "got 3"),
        (
            "family: low\nmethod: sac\nseed: 0\nrequirements: [{name: a, formula: x, scale: -1}]",
            "requirements[0].scale",
            "got -1; wanted >= 0.001",
        ),
        ("families: [low, low]", "families", "wanted each value once"),
        ("[1, 2]", "spec", "holds a list"),
        ("family: [", "spec", "spec.yaml, which is no YAML from line 1, column 10 on: expected"),
        ("family: low\nmethod: a: b", "spec", "spec.yaml, which is no YAML from line 2, column 10 on: mapping"),
        ("family: low\nbuget: {episodes: 5}", "buget", "did you mean budget?"),
        ("famly: low\nseed: 0", "famly", "did you mean family?"),
        ("family: 2020-01-01\nmethod: sac\nseed: 0", "family", "2020"),
    ],
)
def test_wrong_file_names_the_field(tmp_path: Path, text: str, field: str, message: str) -> None:
    with pytest.raises(ConfigError) as raised:
        read_spec(yaml_file(tmp_path, text), FLAGS)
    assert raised.value.field == field
    assert message in str(raised.value)


CAMPAIGN_FLAGS: dict[str, Any] = dict.fromkeys(("families", "methods", "seeds", "episodes", "evaluation_episodes"))
DEFAULTS: dict[str, Any] = {"families": ["low"], "methods": ["sac"], "seeds": [0, 1]}


def test_campaign_written_as_yaml_is_the_same_campaign(tmp_path: Path) -> None:
    text = "label: 'a: b'\nego: {profile: perfect}\nlearner: {lagrangian: {learning_rate: 1.0e-7}}\n"
    text += "odd: {environment: {friction: {low: 0.5, high: 0.7}}}\n"
    text += "requirements: [{name: slow, formula: ego_speed_mps < 5, scale: 1.0}]\n"
    spec = read_campaign(yaml_file(tmp_path, text), CAMPAIGN_FLAGS, DEFAULTS)
    again = read_campaign(yaml_file(tmp_path, campaign_yaml(spec)), CAMPAIGN_FLAGS, {})
    assert again == spec
    assert again.digest == spec.digest
    assert read_campaign(None, CAMPAIGN_FLAGS, DEFAULTS).digest != spec.digest
