import json

from risk_sac.metrics import Funnel
from risk_sac.records import Outcome
from service.store.stored import StoredEpisode
from service.views.bodies import episode_body


def shown(record, funnel=None):
    return episode_body(
        StoredEpisode(
            number=1,
            sequence=1,
            run_id="r",
            record=record,
            series=None,
            series_sha256=None,
            wall_s=0.5,
            funnel=funnel,
            repetition=None,
        )
    )


def test_a_contact_says_who_would_have_prevented_it(episode):
    body = shown(episode(3, Outcome.FAILURE).record, Funnel(contacts=4, valid=3, distinct=2, preventable=1))
    found = json.loads(body.model_dump_json())
    judged = found["collision"]["judgement"]
    assert (judged["grade"], judged["conflict_type"], judged["conflict_s"]) == ("careful", "cut_in", 2.5)
    assert judged["broke"] == ["red_light", "speeding"]
    assert judged["drivers"]["bound"] == {"avoids": True, "impact_speed_mps": 0.0}
    assert found["funnel"] == {"contacts": 4, "valid": 3, "distinct": 2, "preventable": 1}


def test_a_contact_from_before_there_were_judgements_has_none(episode):
    record = episode(3, Outcome.FAILURE).record
    unjudged = record.collision.model_copy(update={"judgement": None})
    body = shown(record.model_copy(update={"collision": unjudged}))
    assert (body.collision.judgement, body.funnel) == (None, None)


def test_numbers_that_are_not_finite_are_null(episode):
    body = json.loads(shown(episode(3, Outcome.FAILURE).record).model_dump_json())
    assert body["min_ttc_s"] is None
    assert body["collision"]["early_min_ttc_s"] is None
    assert body["collision"]["early_min_robustness"] is None
    assert body["collision"]["ego_speed_mps"] == 9.0


def test_an_episodes_minima_and_those_of_its_collision_are_called_differently(episode):
    body = json.loads(shown(episode(3, Outcome.FAILURE).record).model_dump_json())
    assert {"min_ttc_s", "min_robustness"} <= body.keys()
    assert {"early_min_ttc_s", "early_min_robustness"} <= body["collision"].keys()
    assert not body.keys() & body["collision"].keys()
