"""Titles and examples of all calls, for the page that describes the API."""

import json
import shlex
from collections.abc import Mapping
from typing import Any
from urllib.parse import urlencode

SERVER = "http://127.0.0.1:8000"
TITLES = {
    "put_triage": "Set triage",
    "get_log": "Get run log",
    "get_scenes": "Get scene effects",
    "get_bundle": "Get replay bundle",
    "get_core": "Get minimal failure",
    "get_region": "Get failing region",
    "get_twin": "Get twin picture",
    "get_twin_play": "Get twin recording",
    "get_export": "Export failure",
    "get_episodes_export": "Export episodes",
}
"""Of operations whose name would say too little; see `title`."""
PARAMETERS: Mapping[str, str] = {
    "campaign_id": "c197f3a52d8e06b4c",
    "failure_id": "low-archive-0-search-17",
    "run_id": "low-archive-0",
    "network_id": "n0ca7d1f36b2e8450",
    "regression_id": "c197f3a52d8e06b4c-3f9a1c5b7d2e4068",
    "twin": "idle",
    "name": "ecr_low",
    "format": "png",
}
"""Of what a path has to name."""
QUERIES: Mapping[str, Mapping[str, str]] = {
    "list_campaigns": {"state": "running", "search": "nightly"},
    "list_episodes": {"outcome": "failure", "limit": "10"},
    "list_failures": {"grade": "preventable", "severity": "severe"},
    "get_curves": {"points": "50"},
    "get_log": {"lines": "20"},
    "get_failure_table": {"tier": "valid"},
    "get_events": {"newest": "100"},
    "get_table": {"format": "md"},
    "get_spec": {"format": "yaml"},
    "get_report": {"format": "html"},
    "get_export": {"format": "openscenario"},
    "get_episodes_export": {"format": "parquet"},
    "list_networks": {"limit": "20"},
    "post_network": {"label": "my town"},
}
CAMPAIGN = {"families": ["low"], "methods": ["archive", "random"], "budget": {"episodes": 60}}
CAMPAIGNS = {
    "A quick look": CAMPAIGN,
    "A requirement of your own": CAMPAIGN
    | {"requirements": [{"name": "brakes_gently", "formula": "ego_braking_mps2 <= 4"}]},
    "On an uploaded network": {
        "network": PARAMETERS["network_id"],
        "pattern": "junction",
        "places": "all",
        "methods": ["archive"],
    },
}
BODIES: Mapping[str, Mapping[str, Any]] = {
    "post_campaign": CAMPAIGNS,
    "check_campaign": CAMPAIGNS,
    "put_triage": {"A confirmed failure": {"state": "confirmed", "comment": "late braking, see ticket 12"}},
    "post_regression": {
        "Another ego": {"campaign_id": PARAMETERS["campaign_id"], "ego": {"profile": "careful"}},
    },
}


def describe_calls(paths: dict[str, dict[str, Any]]) -> None:
    """Gives each operation a title, and an example to its path, its body and its description."""
    for path, operations in paths.items():
        for method, operation in operations.items():
            name = operation["operationId"]
            operation["summary"] = title(name)
            for parameter in operation.get("parameters", []):
                if parameter.get("required"):
                    parameter["example"] = example_of(name, parameter["name"])
            bodies = BODIES.get(name, {})
            for content in operation.get("requestBody", {}).get("content", {}).values() if bodies else ():
                content["examples"] = {said: {"value": value} for said, value in bodies.items()}
            operation["description"] += f"\n\nExample: `{command(method, path, name)}`"


def title(name: str) -> str:
    """`list_campaigns` -> `List campaigns`."""
    return TITLES.get(name, name.replace("_", " ").capitalize())


def example_of(operation: str, parameter: str) -> str:
    """Returns an example of a parameter in a call of an operation."""
    return QUERIES.get(operation, {}).get(parameter) or PARAMETERS[parameter]


def command(method: str, path: str, name: str) -> str:
    """The call for a shell."""
    query = QUERIES.get(name)
    address = SERVER + path.format(**PARAMETERS) + (f"?{urlencode(query)}" if query else "")
    words = ["curl", "-s", *([] if method == "get" else ["-X", method.upper()]), address]
    if name == "post_network":
        words += ["-H", "content-type: application/xml", "--data-binary", "@town.net.xml"]
    for body in list(BODIES.get(name, {}).values())[:1]:
        words += ["-H", "content-type: application/json", "-d", json.dumps(body)]
    return shlex.join(words)
