"""`python -m risk_sac.execution.ray.bridge [FOLDER]`: stands between server and cluster, and may die in its place.

FOLDER holds those of all runs; without it nobody tries whether the nodes see it.

Ray ends the process that uses it when its cluster is lost for a minute. So the server does not use it: it talks to
this process by lines of JSON, and starts another one when this one has ended. The end of standard input ends it, and
with it go its tasks on all nodes.
"""

import json
import logging
import os
import sys
import threading
import time
from dataclasses import asdict, replace
from pathlib import Path
from typing import IO, Any

import ray

from risk_sac.errors import ConfigError
from risk_sac.execution.ray import checks, reach
from risk_sac.execution.ray.following import Followed
from risk_sac.execution.ray.join import joined
from risk_sac.execution.ray.settings import RaySettings, read_settings
from risk_sac.execution.ray.versions import versions
from risk_sac.execution.ray.words import Order, exited_json, line, order_of

logger = logging.getLogger("risk_sac.execution.ray.bridge")

LOOK_S = 1.0
NODES_S = 2.0


class Bridge:
    """Carries orders to the cluster and reports back; a thread follows each attempt."""

    def __init__(self, settings: RaySettings, words: IO[bytes]) -> None:
        self._settings = settings
        self._words = words
        self._telling = threading.Lock()
        self._lock = threading.Lock()
        self._latest: dict[int, Followed] = {}
        self._expected = versions()
        self.heard_of_head = time.monotonic()

    def tell(self, kind: str, **content: Any) -> None:
        """Says something to the server."""
        message = line(kind, **content)
        with self._telling:
            self._words.write(message)
            self._words.flush()

    def submit(self, order: Order) -> None:
        """Begins an attempt; an older one at the same run is given up."""
        followed = Followed(order, self._settings, self._expected, self._said)
        with self._lock:
            overtaken = self._latest.get(order.number)
            self._latest[order.number] = followed
        threading.Thread(target=self._follow, args=(followed, overtaken), daemon=True).start()

    def _follow(self, followed: Followed, overtaken: Followed | None) -> None:
        if overtaken is not None:
            overtaken.give_up()
        exited, order = followed.follow(), followed.order
        with self._lock:
            if self._latest.get(order.number) is not followed:
                return
            del self._latest[order.number]
        self.tell("exited", number=order.number, token=order.token, exited=exited_json(exited))

    def _said(self, order: Order, lines: list[str]) -> None:
        self.tell("said", number=order.number, token=order.token, lines=lines)

    def cancel(self, number: int, token: str, grace_s: float) -> None:
        """Tells an attempt to stop."""
        with self._lock:
            followed = self._latest.get(number)
        if followed is not None and followed.order.token == token:
            followed.stop(grace_s)

    def watch(self) -> None:
        """Tells of the cluster every few seconds."""
        while True:
            found = ray.nodes()
            self.heard_of_head = time.monotonic()
            with self._lock:
                at_work = list(self._latest.values())
            nodes = []
            for node in checks.nodes(found, self._settings):
                silences = [each.silent_s for each in at_work if each.node == node.id]
                nodes.append(asdict(replace(node, runs=len(silences), silent_s=min(silences, default=0.0))))
            self.tell("nodes", nodes=nodes)
            time.sleep(NODES_S)


def main() -> None:
    """Connects, checks the cluster, and carries orders until nobody gives any more."""
    logging.basicConfig(level=logging.INFO, format="%(levelname)s %(name)s: %(message)s")
    words = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what Ray prints of itself is no message
    within = Path(sys.argv[1]) if len(sys.argv) > 1 else None
    try:
        settings = read_settings()
        bridge = Bridge(settings, words)
        reach.check_head(settings)
        with joined(settings) as node:
            reach.connect(settings, node)
            checks.check(settings, within)
            bridge.tell("ready")
            _carry(bridge, settings.ray_lease_s)
    except ConfigError as error:
        words.write(line("refused", error=error.args))
        words.flush()
        return
    os._exit(0)


def _carry(bridge: Bridge, lease_s: float) -> None:
    """Until nobody gives orders any more, or the head is gone: a cluster dies with it."""
    over = threading.Event()
    threading.Thread(target=bridge.watch, daemon=True).start()
    threading.Thread(target=_listen, args=(bridge, over), daemon=True).start()
    while not over.wait(LOOK_S):
        if time.monotonic() - bridge.heard_of_head > lease_s:
            logger.error("nothing was heard of the cluster's head for %g s", lease_s)
            return


def _listen(bridge: Bridge, over: threading.Event) -> None:
    for text in sys.stdin:
        content = json.loads(text)
        if content.pop("kind") == "submit":
            bridge.submit(order_of(content))
        else:
            bridge.cancel(content["number"], content["token"], content["grace_s"])
    over.set()


if __name__ == "__main__":
    main()
