"""Regressions of several keys on one server."""

import threading
import time
from contextlib import ExitStack
from pathlib import Path

import httpx
import pytest

from risk_sac.execution.helper import HelperResult
from service.keys import KeyFile, Scope
from service.runs import regressions
from service.settings import ServiceSettings
from tests.contract.recorded_campaigns import ENDED_ID, Recorded, known_times_and_ids
from tests.contract.serving import serving


def test_keys_take_turns_and_each_waits_for_its_share(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    settings, gate, played = ServiceSettings(data_dir=tmp_path, max_workers=1), threading.Event(), list[float]()

    def play(*_: object, question: bytes, **__: object) -> HelperResult:
        played.append(regressions.EgoConfig.model_validate_json(question).reaction_time_s)
        assert gate.wait(600)
        return HelperResult(1, b"", "none was played")

    monkeypatch.setattr(regressions, "run_helper", play)
    with known_times_and_ids() as clock:
        Recorded(settings, clock).write()
    file = KeyFile(settings.keys_file)
    busy, other = (file.create("default", "", Scope.ADMIN)[1] for _ in range(2))
    with serving(settings) as url, httpx.Client(base_url=url, timeout=600) as client, ExitStack() as stack:
        stack.callback(gate.set)

        def post(key: str, reaction_time_s: float) -> httpx.Response:
            body = {"campaign_id": ENDED_ID, "ego": {"reaction_time_s": reaction_time_s}}
            return client.post("/v1/regressions", json=body, headers={"authorization": f"Bearer {key}"})

        assert post(busy, 0.1).status_code == 202
        while not played:  # it waits no longer
            time.sleep(0.01)
        share = regressions.MOST_WAITING // 2
        assert {post(busy, round(0.2 + number / 10, 1)).status_code for number in range(share)} == {202}
        refused = post(busy, 1.5)
        assert (refused.status_code, refused.json()["reason"]) == (429, "quota_exceeded")
        assert refused.headers["retry-after"] == "10"
        assert post(busy, 0.2).status_code == 202, "the same as before"
        assert post(other, 2.0).status_code == 202
        gate.set()
        while len(played) < share + 2:
            time.sleep(0.01)
    assert played[:4] == pytest.approx([0.1, 0.2, 2.0, 0.3])
