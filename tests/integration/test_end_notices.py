"""A server notifies `on_end` of a campaign's end, if the operator allows."""

from contextlib import closing

from tests.receiver import Receiver
from tests.server import servers


def test_the_end_of_a_campaign_is_posted_and_shown_in_it(tmp_path):
    with closing(Receiver()) as receiver, servers(tmp_path) as start:
        server = start(on_end=f'["{receiver.url}"]')
        refused = server.client.post("/v1/campaigns", json={"families": ["low"], "on_end": "http://127.0.0.1:1/hooks"})
        assert (refused.status_code, refused.json()["errors"][0]["field"]) == (422, "on_end")
        short = {"budget": {"episodes": 3}}
        plain, told = server.post(**short), server.post(**short, on_end=f"{receiver.url}/ci")
        seen = server.wait_for(told, lambda seen: seen["notice"]["state"] != "waiting")
        assert seen["notice"] == {"state": "delivered", "tries": 1, "reason": None}
        assert server.wait(plain)["notice"] is None
        (message,) = receiver.messages
        assert (message["campaign"], message["state"]) == (told, seen["state"])
        assert server.client.get(message["link"]).json()["id"] == told
