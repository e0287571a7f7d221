import platform

from risk_sac import __version__
from risk_sac.execution.ray.node import differing, versions


def test_python_packages_and_egos_are_told_with_their_versions():
    found = versions()
    assert found["python"] == platform.python_version()
    assert found["risk-sac"] == __version__
    assert found["libsumo"].count(".") == 2
    assert found["the ego r157"].count("+") == 1


def test_a_node_that_is_the_same_or_has_more_does_not_differ():
    assert differing({"python": "3.11.7", "the ego own": "1"}, {"python": "3.11.7"}) == ""


def test_all_that_differs_or_is_missing_is_told_with_what_is_wanted():
    told = differing({"python": "3.11.9"}, {"python": "3.11.7", "ray": "2.60.0"})
    assert told == "python is 3.11.9; wanted 3.11.7, ray is missing; wanted 2.60.0, as on the server's machine"
