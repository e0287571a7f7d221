from risk_sac.execution.ray.node import differing


def test_all_that_differs_or_is_missing_is_told_with_what_is_wanted():
    told = differing({"python": "3.11.9"}, {"python": "3.11.7", "ray": "2.60.0"})
    assert told == "python is 3.11.9; wanted 3.11.7, ray is missing; wanted 2.60.0, as on the server's machine"
