"""`python -m service`: serve in the foreground."""

import contextlib
import gc
import os
import sys

from risk_sac.egos import registry
from risk_sac.errors import ConfigError, RiskSacError
from risk_sac.execution import executor_named
from service.api.connections import Server
from service.app import create_app
from service.host import set_up_logs
from service.keys import check_exposure
from service.runs.manager import worker_program
from service.settings import MISUSED, read_settings

ANSWERS_END_S = 2  # for answers and streams at work when the server stops; workers are stopped after that
SWITCH_S = 0.001  # for which a busy thread may hold up the event loop, and with it all answers; 5 ms by default


def main() -> None:
    """Serve until told to stop."""
    try:
        settings = read_settings()
        set_up_logs(settings.log_format)
        if settings.egos is not None:  # from a folder of secrets, it may be; workers read the environment
            os.environ[registry.FILE] = str(settings.egos.absolute())
        registry.cards()  # refuses invalid egos at the start
        check_exposure(settings)
        executor = executor_named(settings.executor)(worker_program(settings))  # tries a cluster, which takes seconds
    except ConfigError as error:
        print(error, file=sys.stderr)  # noqa: T201 - no log yet
        sys.exit(MISUSED)
    except RiskSacError as error:
        sys.exit(str(error))
    app = create_app(settings, executor)
    # What the imports left is no garbage; to look through it again and again would hold up all answers for 0.1 s.
    gc.collect()
    gc.freeze()
    sys.setswitchinterval(SWITCH_S)
    server = Server(
        app,
        settings,
        host=settings.host,
        port=settings.port,
        log_config=None,
        access_log=False,
        server_header=False,
        ws="none",
        timeout_graceful_shutdown=ANSWERS_END_S,
    )
    with contextlib.suppress(KeyboardInterrupt):
        server.run()


if __name__ == "__main__":
    main()
