"""A process beside the server: one real Python, which reads what it is told."""

import os
import threading
import time

from service.settings import ServiceSettings
from service.views.asides import Aside

NICENESS = 7
TELL = b"import os, sys; _ = sys.stderr.write(f'{os.getpriority(0, 0)} is its niceness'); sys.stderr.flush()\n"


def test_it_is_nicer_than_the_server_and_gone_when_the_server_stops(tmp_path):
    aside = Aside(ServiceSettings(data_dir=tmp_path, worker_niceness=NICENESS))
    log = tmp_path / "log"
    ended: list[int] = []
    with log.open("wb") as errors:
        # The interactive interpreter: it does what it is told, and then waits for more, which never comes.
        asking = threading.Thread(target=lambda: ended.append(aside.run("code", ["-q"], errors, TELL)))
        asking.start()
        while b"is its niceness" not in log.read_bytes():
            time.sleep(0.02)
        assert not ended
        aside.stop()
        asking.join()
    assert ended == [-9]
    assert f"{os.getpriority(os.PRIO_PROCESS, 0) + NICENESS} is its niceness" in log.read_text()
