import httpx
import pytest

from service.api.routes import events


def test_a_stream_without_news_beats(base_url, monkeypatch):
    assert events.HEARTBEAT_S == 15
    monkeypatch.setattr(events, "HEARTBEAT_S", 0.05)
    campaign_id = httpx.post(f"{base_url}/v1/campaigns", json={"families": ["low"]}).json()["id"]
    beats = 0
    with httpx.stream("GET", f"{base_url}/v1/campaigns/{campaign_id}/events") as stream:
        for line in stream.iter_lines():
            beats += line == ": alive"
            if beats == 3:
                return
    pytest.fail("the stream ended")
