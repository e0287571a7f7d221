"""`python -m risk_sac` is `risk-sac`."""

import gc
from typing import NoReturn

gc.set_threshold(50_000)  # Loading makes lasting objects; Python's 700 searches them for garbage time and again.

from risk_sac.cli import main  # noqa: E402
from risk_sac.host.process_state import leave  # noqa: E402


def command() -> NoReturn:
    """Run the command line as a process of its own."""
    leave(main())


if __name__ == "__main__":
    command()
