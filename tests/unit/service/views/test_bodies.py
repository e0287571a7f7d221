import dataclasses
import json
import typing

import pytest
from pydantic import TypeAdapter

from risk_sac.metrics import Funnel
from risk_sac.types import Collision, EpisodeRecord, Judgement, Outcome, ReferenceOutcome, RunMetrics
from service import schemas
from service.store.records import StoredEpisode
from service.views.bodies import episode_body

each_record = pytest.mark.parametrize(
    ("record", "body", "added"),
    [
        (RunMetrics, schemas.Metrics, set()),
        (Collision, schemas.Collision, set()),
        (Judgement, schemas.Judgement, set()),
        (ReferenceOutcome, schemas.ReferenceOutcome, set()),
        (Funnel, schemas.Funnel, set()),
        (EpisodeRecord, schemas.Episode, {"id", "run_id", "wall_s", "funnel"}),
    ],
)


@each_record
def test_what_may_be_none_in_a_record_may_be_null_in_its_body(record, body, added):
    for name, hint in typing.get_type_hints(record).items():
        if type(None) in typing.get_args(hint):
            assert TypeAdapter(body.model_fields[name].annotation).validate_python(None) is None, name


@each_record
def test_a_body_has_every_field_of_its_record(record, body, added):
    assert {field.name for field in dataclasses.fields(record)} | added == set(body.model_fields)


def shown(record, funnel=None):
    return episode_body(
        StoredEpisode(
            number=1, sequence=1, run_id="r", record=record, series=None, series_sha256=None, wall_s=0.5, funnel=funnel
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
    body = shown(dataclasses.replace(record, collision=dataclasses.replace(record.collision, judgement=None)))
    assert (body.collision.judgement, body.funnel) == (None, None)


def test_numbers_that_are_not_finite_are_null(episode):
    body = shown(episode(3, Outcome.FAILURE).record)
    assert body.min_ttc_s is None
    assert body.collision.min_ttc_s is None
    assert body.collision.min_robustness is None
    assert body.collision.ego_speed_mps == 9.0
