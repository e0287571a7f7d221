"""Where a server may listen."""

import ipaddress

from risk_sac.errors import ConfigError
from service.keys.file import KeyFile
from service.settings import ServiceSettings


def is_loopback(host: str) -> bool:
    """Whether only processes of this machine reach a server that listens there."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def check_exposure(settings: ServiceSettings) -> None:
    """Refuses to serve other machines without keys, and anybody with keys that cannot be read.

    Raises:
      ConfigError: the host is no loopback address, and no key counts.
      KeysError: the keys file cannot be read, or is damaged.
    """
    keys = KeyFile(settings.keys_file).read()
    if is_loopback(settings.host) or any(key.revoked_at is None for key in keys):
        return
    remedy = "create one with `risk-sac keys create`"
    raise ConfigError("host", repr(settings.host), "a loopback address, or API keys", remedy)
