"""An ego over its versions: what is compared, and what is not."""

import pytest

from risk_sac.config import CampaignSpec, EgoConfig
from risk_sac.config.campaign import BoundaryConfig
from risk_sac.errors import ConfigError
from risk_sac.metrics import wilson_interval
from risk_sac.records import RequirementCounts
from risk_sac.records.rates import BoundaryAxis, BoundaryMap, BoxShare, DriverMap
from risk_sac.report.trend import check_scenarios, trend
from tests.builders import run_metrics
from tests.versions import SOFTWARE, ended_campaign


def test_a_kind_is_new_gone_or_returned():
    (row,) = trend([ended_campaign("1.3", "ab"), ended_campaign("1.4", "bc"), ended_campaign("1.5", "ac")]).rows
    assert [point.version for point in row.points] == ["1.3", "1.4", "1.5"]
    assert [(point.new, point.gone, point.returned) for point in row.points] == [
        (None, None, None),
        (("c",), ("a",), ()),
        ((), ("b",), ("a",)),
    ]
    assert [point.headline for point in row.points] == [2, 2, 2]


@pytest.mark.parametrize("name", ["definitions", "risk-sac", "libsumo"])
def test_nothing_is_compared_across_a_change_of_what_judged(name):
    newer = SOFTWARE | {name: "11"}
    (row,) = trend(
        [
            ended_campaign("1.3", "a"),
            ended_campaign("1.4", "b", versions=newer),
            ended_campaign("1.5", "ab", versions=newer),
        ]
    ).rows
    assert [point.changed for point in row.points] == [(), (name,), ()]
    assert row.points[1].new is None
    assert (row.points[2].new, row.points[2].returned) == (("a",), ()), "what came before the change does not count"


def test_another_package_is_no_change():
    (row,) = trend([ended_campaign("1.3", "a"), ended_campaign("1.4", "a", versions=SOFTWARE | {"torch": "3"})]).rows
    assert row.points[1].changed == ()
    assert row.points[1].new == ()


def test_without_a_replay_no_kind_is_known():
    (row,) = trend([ended_campaign("1.3", "a"), ended_campaign("1.4", None), ended_campaign("1.5", "a")]).rows
    assert row.points[1].headline is None
    assert row.points[1].kinds is None
    assert [point.gone for point in row.points] == [None, None, None]


@pytest.mark.parametrize(
    ("changes", "differs"),
    [
        ({"budget": {"episodes": 20}}, "budget.episodes"),
        ({"methods": ("random",)}, "methods"),
        ({"families": ("dense",)}, "families"),
        ({"odd": {"dynamic": {"behaviour": "extreme"}}}, "odd.dynamic.behaviour"),
        ({"seeds": (0, 1)}, "seeds"),
    ],
)
def test_campaigns_on_other_terms_are_in_another_row(changes, differs):
    spec = CampaignSpec.model_validate({"families": ("low",), "methods": ("archive",)} | changes)
    other = ended_campaign("1.5", "a", **{name: getattr(spec, name) for name in changes})
    rows = trend([ended_campaign("1.3"), ended_campaign("1.4"), other]).rows
    assert [len(row.points) for row in rows] == [2, 1]
    assert rows[0].differs == ()
    assert differs in rows[1].differs


def test_which_seeds_are_drawn_is_no_term():
    (row,) = trend([ended_campaign("1.3", seeds=(0,)), ended_campaign("1.4", seeds=(7,), label="nightly")]).rows
    assert len(row.points) == 2


def test_the_newest_campaign_of_a_version_counts_at_the_place_of_its_first():
    again = ended_campaign("1.3", "b")
    (row,) = trend([ended_campaign("1.3", "a"), ended_campaign("1.4", "b"), again]).rows
    assert [(point.version, point.kinds, point.earlier) for point in row.points] == [
        ("1.3", ("b",), ("c1.3",)),
        ("1.4", ("b",), ()),
    ]


def test_egos_have_rows_of_their_own_and_settings_tell_versions_apart():
    rows = trend(
        [
            ended_campaign(None, ego={"driver": None, "reaction_time_s": 1.0}),
            ended_campaign(None, ego={"driver": None}),
            ended_campaign("1.4", ego={"driver": "r157", "version": "1.0+abc"}),
        ]
    ).rows
    assert [row.ego for row in rows] == ["default", "r157"]
    assert [(point.version, point.settings) for point in rows[0].points] == [
        ("libsumo 1.28.0", ("reaction_time_s 1.0",)),
        ("libsumo 1.28.0", ()),
    ]
    (registered,) = rows[1].points
    assert (registered.version, registered.registered, registered.settings) == ("1.4", "1.0+abc", ())


def test_rates_are_of_freshly_drawn_scenes_that_were_played():
    reported = RequirementCounts(counts="report", violated=5)
    drawn = run_metrics(
        episodes=50, rejected=8, invalid=2, failures=4, requirements={"no_contact": _counts(4), "safe_ttc": reported}
    )
    (row,) = trend([ended_campaign("1.3", drawn=drawn)]).rows
    (point,) = row.points
    rates = {rate.requirement: rate for rate in point.rates}
    assert {name: (rate.count, rate.played) for name, rate in rates.items()} == {
        None: (4, 40),
        "no_contact": (4, 40),
        "safe_ttc": (5, 40),
    }
    assert (rates[None].rate, (rates[None].low, rates[None].high)) == (0.1, wilson_interval(4, 40))
    assert point.requirements == {}, "of the searches alone"


def _counts(valid: int) -> RequirementCounts:
    return RequirementCounts(counts="failure", violated=valid, valid=valid)


def test_areas_are_those_beside_published_drivers():
    share = BoxShare(share=0.2, low=0.1, high=0.3)
    axis = BoundaryAxis(name="gap_m", unit="m", meaning="", low=0.0, high=1.0, levels=(0.0, 1.0), has_effect=True)
    told = {"judged": True, "episodes": 9, "always": None, "probability": (), "deviation": (), "fails": share}
    maps = tuple(
        DriverMap(name=name, ego_fails_alone=None if name == "ego" else share, **told)
        for name in ("ego", "r157", "idm-aeb")
    )
    settings = BoundaryConfig(over=("gap_m", "speed_mps"))
    found = BoundaryMap(
        family="low",
        ego=EgoConfig(),
        settings=settings,
        axes=(axis, axis),
        fixed={},
        points=(),
        refused=0,
        maps=maps,
        notes=(),
    )
    (row,) = trend([ended_campaign("1.3", boundary=found)]).rows
    (area,) = row.points[0].areas
    assert (area.driver, area.family, area.parameters) == ("r157", "low", ("gap_m", "gap_m"))
    assert (area.rate, area.low, area.high) == (0.2, 0.1, 0.3)


def test_campaigns_of_other_scenarios_that_were_chosen_are_refused():
    with pytest.raises(ConfigError) as refused:
        check_scenarios([ended_campaign("1.3"), ended_campaign("1.4", families=("dense",))])
    assert refused.value.field == "campaign"
    check_scenarios([ended_campaign("1.3"), ended_campaign("1.4", budget=ended_campaign("1").spec.budget)])


def test_an_ego_that_was_never_tested_has_no_row():
    assert trend([]).rows == ()
