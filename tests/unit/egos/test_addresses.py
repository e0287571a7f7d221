"""What an operator may write as the address of a remote ego."""

import pytest

from risk_sac.config import EgoConfig
from risk_sac.egos.registry import addresses_of, card_of, instances_of
from risk_sac.errors import ConfigError


@pytest.mark.parametrize(
    ("text", "addresses"),
    [
        ("127.0.0.1:7000", ("127.0.0.1:7000",)),
        ("a:7000-7002", ("a:7000", "a:7001", "a:7002")),
        ("a:1, b:2,a:1", ("a:1", "b:2", "a:1")),
        ("[::1]:9-10", ("[::1]:9", "[::1]:10")),
        ("unix:///tmp/ego,ego-2.local:65535", ("unix:///tmp/ego", "ego-2.local:65535")),
    ],
)
def test_an_address_names_a_server_or_several(text: str, addresses: tuple[str, ...]) -> None:
    assert addresses_of(text) == addresses


@pytest.mark.parametrize(
    ("text", "got"),
    [
        ("", "''"),
        ("7000", "'7000'"),
        ("a:1,,b:2", "'' in 'a:1,,b:2'"),
        ("a:7000-", "'a:7000-'"),
        ("a:0", "'a:0'"),
        ("a:65530-65536", "'a:65530-65536'"),
        ("a:9-8", "'a:9-8'"),
        ("http://a:1", "'http://a:1'"),
        ("a:1-2000", "2000 addresses"),
    ],
)
def test_bad_addresses_are_refused_in_a_line(text: str, got: str) -> None:
    with pytest.raises(ConfigError) as refused:
        addresses_of(text)
    assert refused.value.got == got
    assert refused.value.expected
    assert refused.value.remedy


def test_a_card_counts_the_servers_of_its_ego(tmp_path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "egos.toml"
    monkeypatch.setenv("RISK_SAC_EGOS", str(file))
    file.write_text('[far]\naddress = "a:7000-7015"\nversion = "1"\nresponse_time_s = 1\n')
    assert instances_of(EgoConfig(driver="far")) == 16
    assert instances_of(EgoConfig(driver="r157")) is None
    assert instances_of(EgoConfig()) is None
    assert "address" not in card_of("far").model_dump()
    file.write_text('[far]\naddress = "a:b"\nversion = "1"\nresponse_time_s = 1\n')
    with pytest.raises(ConfigError, match=r"RISK_SAC_EGOS: far\.address: got 'a:b'; wanted host:port"):
        card_of("far")
