import pytest

from risk_sac.client import Client
from risk_sac.errors import ConfigError
from tests.unit.client.scripted_server import Server, campaign


@pytest.mark.parametrize(
    "url", ["", "localhost:8000", "ftp://host", "http://", "http://[", "http://host:99999", "a\nb"]
)
def test_what_is_no_url_is_refused(url: str) -> None:
    with pytest.raises(ConfigError, match="wanted http") as caught:
        Client(url)
    assert caught.value.field == "url"


def test_a_password_in_the_url_is_refused_and_not_shown() -> None:
    with pytest.raises(ConfigError) as caught:
        Client("http://me:hunter2@host")
    assert "hunter2" not in str(caught.value)


@pytest.mark.parametrize("key", ["", "two words", "line\nbreak", "schlüssel"])
def test_a_key_that_no_header_can_hold_is_refused_and_not_shown(key: str) -> None:
    with pytest.raises(ConfigError) as caught:
        Client(key=key)
    assert not key or key not in str(caught.value)


PROXIES = ("http_proxy", "https_proxy", "all_proxy", "no_proxy")


@pytest.mark.parametrize("proxy", ["http://127.0.0.1:9", "socks5://127.0.0.1:9", "nonsense://x"])
@pytest.mark.parametrize("name", PROXIES[:3])
def test_loopback_is_reached_whatever_proxy_there_is(
    name: str, proxy: str, server: Server, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(name, proxy)
    server.answer(200, campaign())
    for host in ("127.0.0.1", "localhost", "[::ffff:127.0.0.1]"):
        with Client(f"http://{host}:{server.server_port}", patience_s=0.1) as client:
            assert client.campaign("c1").id == "c1"


@pytest.mark.parametrize(("name", "value"), [("all_proxy", "socks5://127.0.0.1:9"), ("https_proxy", "nonsense://x")])
def test_a_proxy_that_cannot_be_used_is_named(name: str, value: str, monkeypatch: pytest.MonkeyPatch) -> None:
    for each in PROXIES:
        monkeypatch.delenv(each, raising=False)
    monkeypatch.setenv(name, value)
    with pytest.raises(ConfigError, match=r"proxy: .*mend HTTP_PROXY"):
        Client("https://search.example")
