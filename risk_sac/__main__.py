"""`python -m risk_sac` is `risk-sac`."""

from typing import NoReturn

from risk_sac.host.process_state import collect_seldom, leave

collect_seldom()  # before the modules load

from risk_sac.cli import main  # noqa: E402


def command() -> NoReturn:
    """Run the command line as a process of its own."""
    leave(main())


if __name__ == "__main__":
    command()
