"""HTTP server on a loopback port that gives a test's answers."""

import json
import threading
import time
from collections import deque
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

PROGRESS = {
    "episodes_done": 0,
    "episodes_total": 4,
    "failures": 0,
    "raw_collisions": 0,
    "rejected": 0,
    "distinct_failures": 0,
    "preventable": 0,
    "distinct_preventable": 0,
    "window_ecr": None,
    "window_pcr": None,
    "dual_variable": None,
    "temperature": None,
    "eta_s": None,
}


def campaign(state: str = "running", done: int = 0, **fields: Any) -> dict[str, Any]:
    return {
        "id": "c1",
        "label": "",
        "state": state,
        "reason": None,
        "families": ["low"],
        "methods": ["risk-sac"],
        "ego": {"profile": "default", "car_following": "Krauss"},
        "created_at": "2026-01-02T03:04:05Z",
        "started_at": None,
        "finished_at": None,
        "progress": PROGRESS | {"episodes_done": done},
        "runs": [],
        "spec": {"families": ["low"]},
    } | fields


@dataclass
class Answer:
    """Answer; a list streams events: numbers are pauses, None breaks off."""

    status: int = 200
    body: Any = None
    headers: dict[str, str] = field(default_factory=dict)
    lost: bool = False  # the connection ends without an answer


@dataclass
class Asked:
    method: str
    path: str
    headers: dict[str, str]
    body: str
    at: float


class Server(ThreadingHTTPServer):
    """Server that gives its answers in turn and repeats the last one."""

    daemon_threads = True

    def __init__(self, port: int = 0) -> None:
        self.answers: deque[Answer] = deque()
        self.by_path: dict[str, deque[Answer]] = {}  # where two conversations are held at once
        self.asked: list[Asked] = []
        super().__init__(("127.0.0.1", port), Handler)
        threading.Thread(target=self.serve_forever, args=(0.01,), daemon=True).start()

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.server_port}"

    def answer(self, status: int = 200, body: Any = None, **headers: str) -> None:
        self.answers.append(Answer(status, body, {name.replace("_", "-"): value for name, value in headers.items()}))

    def lose(self) -> None:
        self.answers.append(Answer(lost=True))

    def next(self, path: str) -> Answer:
        waiting = self.by_path.get(path.partition("?")[0], self.answers)
        return waiting.popleft() if len(waiting) > 1 else waiting[0]

    def handle_error(self, request: Any, client_address: Any) -> None:
        pass  # a client that went away


class Handler(BaseHTTPRequestHandler):
    server: Server
    protocol_version = "HTTP/1.1"

    def do_GET(self) -> None:
        body = self.rfile.read(int(self.headers.get("content-length", 0))).decode()
        headers = {name.lower(): value for name, value in self.headers.items()}
        self.server.asked.append(Asked(self.command, self.path, headers, body, time.monotonic()))
        answer = self.server.next(self.path)
        if answer.lost:
            self.close_connection = True
            return
        self.send_response(answer.status)
        for name, value in answer.headers.items():
            self.send_header(name, value)
        if isinstance(answer.body, list):
            self._stream(answer.body)
        else:
            data = answer.body if isinstance(answer.body, bytes) else json.dumps(answer.body).encode()
            data = b"" if answer.body is None else data
            self.send_header("Content-Length", str(len(data)))
            self.end_headers()
            self.wfile.write(data)

    do_POST = do_DELETE = do_GET  # noqa: N815

    def _stream(self, pieces: list[str | float | None]) -> None:
        self.send_header("Content-Type", "text/event-stream")
        self.send_header("Transfer-Encoding", "chunked")
        self.end_headers()
        for piece in [*pieces, ""]:
            if piece is None:
                self.close_connection = True
                return
            if isinstance(piece, float):
                time.sleep(piece)
                continue
            data = piece.encode()
            self.wfile.write(b"%x\r\n%s\r\n" % (len(data), data))

    def log_message(self, *arguments: Any) -> None:
        pass
