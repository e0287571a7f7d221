import json
import math

from risk_sac.failures.question import TwinPlay, twin_bytes
from risk_sac.records import wire
from service.views.pictures import twin_body
from tests.builders import collision, judgement
from tests.unit.service.views.test_series import arrays


def test_a_twin_is_told_with_its_series_and_its_contact_and_null_where_a_number_is_not_finite():
    hit = collision(other_id="lead", ego_speed_mps=5.44, min_ttc_s=math.inf, judgement=judgement())
    body = json.loads(wire(twin_body("idle", twin_bytes(TwinPlay.of(None, hit), arrays()))))
    assert (body["twin"], body["outcome"]) == ("idle", "touches lead at 5.4 m/s")
    assert body["collision"]["early_min_ttc_s"] is None
    assert body["collision"]["judgement"]["signature"] == hit.judgement.signature
    assert body["series"]["x_m"] == [[0.0, 1.0], [2.0, None], [4.0, 5.0]]
    assert body["series"]["robustness"] == [[1.0], [None], [-1.0]]


def test_what_is_not_told_of_a_series_is_left_out():
    series = arrays() | {"least_ttc_s": arrays()["soft_min"]}
    body = twin_body("careful", twin_bytes(TwinPlay.of(None, None), series))
    assert (body.outcome, body.collision) == ("touches nobody", None)
    assert "least_ttc_s" not in body.series.model_dump()
