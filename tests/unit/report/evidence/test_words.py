import pytest

from risk_sac.config import EgoConfig, Odd
from risk_sac.report.evidence.words import FIELDS, ego_in_words, odd_in_words
from risk_sac.scenario.families import FAMILIES


@pytest.mark.parametrize(
    ("ego", "said"),
    [
        ({}, ("profile default", "Krauss", "every 0.5 s", "80 m far over 360°", "not through vehicles")),
        ({"profile": "perfect"}, ("profile perfect", "every 0.1 s", "sees everything")),
        ({"sensor": {"range_m": 30, "occlusion": False, "field_of_view_rad": 3.1416}}, ("30 m far over 180°", "too")),
        ({"driver": "idm", "defects": ("latency", "speeds")}, ("with the planted defects latency and speeds",)),
        ({"driver": "idm", "version": "2"}, ("registered driver idm", "responds within 0.5 s", "80 m far")),
    ],
)
def test_who_drives_and_what_it_sees(ego, said):
    told = ego_in_words(EgoConfig.model_validate(ego))
    assert all(each in told for each in said)
    assert ("profile" in told) is ("driver" not in ego)


def test_every_field_of_the_odd_has_words_and_says_what_both_allow():
    told = dict(odd_in_words(FAMILIES["mixed"], Odd()))
    assert len(told) == len(FIELDS)
    assert told["pedestrian crossings"] == "signalised, zebra"
    assert told["posted limit"] == "13.89 m/s"
    narrowed = Odd.model_validate({"environment": {"friction": {"low": 0.7, "high": 0.9}}})
    assert dict(odd_in_words(FAMILIES["mixed"], narrowed))["friction between tyre and road"] == "0.7 to 0.9"
