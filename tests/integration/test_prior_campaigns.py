"""A campaign that goes on from an earlier one, over REST."""

from collections.abc import Callable
from typing import Any

import httpx

from tests.earlier_runs import run_folder
from tests.server import Service


def refusal(client: httpx.Client, **changes: Any) -> str:
    """What is wrong with a prior."""
    answer = client.post("/v1/campaigns/check", json={"families": ["low"], "methods": ["archive-replay"]} | changes)
    assert answer.status_code == 422, answer.text
    (error,) = answer.json()["errors"]
    assert error["field"] == "prior", answer.text
    assert "\n" not in answer.json()["detail"]
    return str(answer.json()["detail"])


def test_a_campaign_goes_on_from_an_earlier_one(serve_shared: Callable[..., Service]) -> None:
    service = serve_shared()
    client, budget = service.client, {"budget": {"episodes": 2}}
    first, silent = (
        client.post("/v1/campaigns", json={"families": ["low"], "methods": [method]} | budget).json()["id"]
        for method in ("archive", "random")
    )
    assert "which is" in refusal(client, prior=first)  # not ended
    for campaign in (first, silent):
        service.wait_until(lambda campaign=campaign: service.get(campaign)["state"] == "succeeded")
        run_folder(next((service.data_dir / "campaigns" / campaign).iterdir()), scripts=campaign == first)
    assert "whose runs are of low" in refusal(client, prior=first, families=["mixed"])
    assert "followed no scripts" in refusal(client, prior=silent)
    for unknown in ("nothing", "/etc", "..", "v1_0123456789ab"):
        assert "the id of a campaign" in refusal(client, prior=unknown)
    body = {"families": ["low"], "methods": ["archive-replay"], "prior": first} | budget
    second = client.post("/v1/campaigns", json=body).raise_for_status().json()["id"]
    spec = service.get(second, "/spec")
    assert spec["prior"].startswith(f"{first.lower().replace('-', '_')[:20]}")
    client.delete(f"/v1/campaigns/{first}").raise_for_status()
    service.wait_until(lambda: service.get(second)["state"] == "succeeded")
    assert client.post("/v1/campaigns/check", json=spec).status_code == 200  # the copy outlives its source
