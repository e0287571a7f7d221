"""The i.i.d. phase of a campaign: an option that changes nothing where it is not asked for."""

import pytest
from pydantic import ValidationError

from risk_sac.config import CampaignSpec

ENDS = {"families": ["low", "dense"], "methods": ["random", "archive"], "seeds": [0, 7], "iid": {"seed": 7}}


def test_its_runs_come_last_one_for_each_family_and_kind_of_traffic():
    spec = CampaignSpec.model_validate(ENDS)
    ids = [run.id for run in spec.runs()]
    assert len(spec.searches()) == 8
    assert ids[8:] == ["low-iid-undisturbed-7", "low-iid-random-7", "dense-iid-undisturbed-7", "dense-iid-random-7"]
    assert len(set(ids)) == len(ids)
    assert {run.budget.total_episodes for run in spec.drawn()} == {300}
    assert CampaignSpec.model_validate_json(spec.model_dump_json()) == spec


def test_no_generator_of_it_is_seeded_as_one_of_a_search_or_of_another_of_its_runs():
    spec = CampaignSpec.model_validate(ENDS)
    streams = [run.stream for run in spec.drawn()]
    assert len(set(streams)) == 4
    assert min(streams) > 2**31 - 1  # the largest seed that can be posted
    assert all(run.stream == run.seed for run in spec.searches())


def test_nobody_posts_its_runs_as_methods_nor_more_episodes_than_a_campaign_may_have():
    with pytest.raises(ValidationError, match="iid-random"):
        CampaignSpec.model_validate({"families": ["low"], "methods": ["iid-random"]})
    with pytest.raises(ValidationError, match="episodes"):
        CampaignSpec.model_validate({"families": ["low"], "iid": {"episodes": 0}})
    full = {"families": ["low"], "seeds": list(range(20)), "budget": {"episodes": 100_000}}
    assert CampaignSpec.model_validate(full)
    with pytest.raises(ValidationError, match=r"and 600 of the i\.i\.d\. phase; wanted at most 2000000"):
        CampaignSpec.model_validate(full | {"iid": {}})
