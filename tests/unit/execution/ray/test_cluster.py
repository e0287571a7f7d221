import pytest

from risk_sac.errors import ConfigError
from risk_sac.execution.ray.node import differing
from tests.ray_cluster import needs_ray

pytestmark = needs_ray


@pytest.mark.parametrize("host", ["192.0.2.7", "0.0.0.0", "[2001:db8::1]", "no-such-host.invalid"])
def test_one_that_others_reach_or_that_nobody_knows_is_refused_without(monkeypatch, host):
    from risk_sac.execution.ray.bridge import check_token

    for mode in ("disabled", "k8s", ""):
        monkeypatch.setenv("RAY_AUTH_MODE", mode)
        with pytest.raises(ConfigError, match="wanted RAY_AUTH_MODE=token on all nodes") as caught:
            check_token(host)
        assert caught.value.field == "RAY_AUTH_MODE"
    monkeypatch.setenv("RAY_AUTH_MODE", "token")
    check_token(host)


def test_all_that_differs_or_is_missing_is_told_with_what_is_wanted():
    told = differing({"python": "3.11.9"}, {"python": "3.11.7", "ray": "2.60.0"})
    assert told == "python is 3.11.9; wanted 3.11.7, ray is missing; wanted 2.60.0, as on the server's machine"
