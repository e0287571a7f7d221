"""Settings from YAML and command-line flags, checked as strictly as REST bodies."""

import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar, get_args

import yaml
from pydantic import ValidationError

from risk_sac.config import IID_METHODS, Budget, CampaignSpec, EgoConfig, RunSpec
from risk_sac.config.base import field_errors, read_fields
from risk_sac.config.ego import ACTUATOR_PRESETS, SENSOR_PRESETS
from risk_sac.errors import ConfigError, did_you_mean

T = TypeVar("T", RunSpec, CampaignSpec, EgoConfig)
PROFILES: tuple[str, ...] = get_args(EgoConfig.model_fields["profile"].annotation)
EGO_NAMES = f"{', '.join(PROFILES)}, a registered ego, one of these as EGO+DEFECT or EGO@PRESET"
EGO_FILE = "a YAML file with the fields of a campaign's ego"
DRIVER = re.compile(r"[a-z][a-z0-9_-]{0,39}")
RUN_DEFAULTS = {"method": "risk-sac", "seed": 0}
SCENARIOS = {"scenario": "family", "scenarios": "families"}  # as a user writes it -> the field of a spec
CAMPAIGN_ONLY = {"family": "families", "method": "methods", "seed": "seeds"}  # a run's field -> a campaign's


def read_spec(file: Path | None, flags: Mapping[str, Any]) -> RunSpec:
    """Returns the run described by a file, overridden by flags.

    Args:
      file: YAML of a RunSpec, or of a CampaignSpec with a single run once the flags have picked one.
      flags: fields of RunSpec, those of its budget and the behaviour under their own names; None where a flag was not
        given.
    """
    given = {name: value for name, value in flags.items() if value is not None}
    data = _placed({} if file is None else with_scenarios(read_fields(file, "spec")), given)
    if data.keys() & {"label", "iid", *CAMPAIGN_ONLY.values()}:
        shared = {name: value for name, value in given.items() if name not in CAMPAIGN_ONLY}
        return _only_run(data | shared, {name: given[name] for name in CAMPAIGN_ONLY if name in given})
    return _validate(RunSpec, RUN_DEFAULTS | data | given)


def read_campaign(file: Path | None, flags: Mapping[str, Any], defaults: Mapping[str, Any]) -> CampaignSpec:
    """Returns the campaign of a YAML file, overridden by flags, over defaults."""
    given = {name: value for name, value in flags.items() if value is not None}
    data = _placed({} if file is None else with_scenarios(read_fields(file, "spec")), given)
    return _validate(CampaignSpec, {**defaults, **data, **given})


def read_posted(file: Path | None, flags: Mapping[str, Any]) -> CampaignSpec | dict[str, Any]:
    """Returns a campaign to post, or unchecked fields for an uploaded network."""
    given = {name: value for name, value in flags.items() if value is not None}
    data = _placed({} if file is None else with_scenarios(read_fields(file, "spec")), given) | given
    return data if "network" in data else _validate(CampaignSpec, data)


def read_ego(text: str) -> EgoConfig:
    """Reads the ego that a command line names.

    It is a profile, a registered ego, or a file with its fields.

    Defects follow a name, then presets of sensors and actuators, such as `idm-aeb+blind-right@radar@by-wire`. Whether
    the defects and an ego of this name exist is found out later.
    """
    named, *presets = text.split("@")
    name, *defects = named.split("+")
    if (name in PROFILES or DRIVER.fullmatch(name)) and not Path(text).exists():
        driver = "profile" if name in PROFILES else "driver"
        return _validate(EgoConfig, {driver: name, "defects": defects, **_equipment(presets)})
    if not Path(text).exists():
        remedy = "check the path, or name an ego of `risk-sac egos list`"
        raise ConfigError("ego", f"{text!r}, which is no file", f"{EGO_NAMES}, or {EGO_FILE}", remedy)
    return _validate(EgoConfig, read_fields(Path(text), "ego"))


def _equipment(presets: Sequence[str]) -> dict[str, str]:
    chosen = dict[str, str]()
    for preset in presets:
        field, known = "sensors" if preset in SENSOR_PRESETS else "actuators", [*SENSOR_PRESETS, *ACTUATOR_PRESETS]
        expected = f"at most one of {', '.join(SENSOR_PRESETS)} and one of {', '.join(ACTUATOR_PRESETS)}"
        if preset not in known:
            raise ConfigError("ego", f"@{preset}", expected, did_you_mean(preset, known))
        if field in chosen:
            raise ConfigError("ego", f"@{preset} beside @{chosen[field]}", expected)
        chosen[field] = preset
    return chosen


def campaign_yaml(spec: CampaignSpec) -> str:
    """A campaign as YAML that reads back as the same campaign."""
    return yaml.safe_dump(spec.model_dump(mode="json"), sort_keys=False, allow_unicode=True)


def _placed(data: dict[str, Any], given: dict[str, Any]) -> dict[str, Any]:
    """Moves budget and behaviour from the flags to their places in specs."""
    budget = {name: given.pop(name) for name in Budget.model_fields if name in given}
    data = _with(data, ("budget",), budget)
    return _with(data, ("odd", "dynamic"), {"behaviour": given.pop("behaviour")}) if "behaviour" in given else data


def with_scenarios(data: dict[str, Any]) -> dict[str, Any]:
    """Renames `scenario` and `scenarios` to the fields that records have."""
    for name, field in SCENARIOS.items():
        if name in data:
            if field in data:
                raise ConfigError(name, f"it beside {field}, which means the same", "one of them")
            data = {field if known == name else known: value for known, value in data.items()}
    return data


def _with(data: dict[str, Any], path: tuple[str, ...], fields: Mapping[str, Any]) -> dict[str, Any]:
    """Adds fields to an object inside a spec.

    A spec that has no object there stays as it is, and is refused later.
    """
    if not path:
        return {**data, **fields}
    stored = data.get(path[0], {})
    return data | {path[0]: _with(stored, path[1:], fields)} if fields and isinstance(stored, dict) else data


def _only_run(data: dict[str, Any], picked: Mapping[str, Any]) -> RunSpec:
    """Picks the one run of a campaign that the flags leave.

    It is of the searches or, by its method's name, of the i.i.d. phase.
    """
    if picked.get("method") in IID_METHODS:
        drawn = _validate(CampaignSpec, data).drawn()
        runs = [run for run in drawn if all(getattr(run, name) == value for name, value in picked.items())]
    else:
        runs = list(_validate(CampaignSpec, data | {CAMPAIGN_ONLY[k]: [v] for k, v in picked.items()}).searches())
    if len(runs) != 1:
        raise ConfigError(
            "spec",
            f"a campaign of {len(runs) or 'no such'} runs",
            "one",
            "pick it with --scenario, --method and --seed",
        )
    return runs[0]


def _validate(model: type[T], data: dict[str, Any]) -> T:
    """Validates through JSON, since strictness refuses YAML's lists for tuples."""
    try:
        return model.model_validate_json(json.dumps(data, default=str), strict=True)
    except ValidationError as error:
        raise field_errors(error, model) from error
