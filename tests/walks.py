"""Files that a real run passes on three walks: `python -m tests.walks`.

A service, its client and one worker play a campaign. An action's walk is the commonest one of all steps. Functions that
numba compiled, and those of libraries, are not seen. `python -m tests.walks FOLDER ...` is that worker.
"""

import json
import os
import sys
import tempfile
import threading
import time
from collections import Counter
from pathlib import Path
from types import CodeType, FrameType
from typing import Any, ClassVar

import httpx
import uvicorn

from risk_sac.client import Client
from risk_sac.config import Budget, CampaignSpec
from service.app import create_app
from service.settings import ServiceSettings
from tests.ports import free_port

ROOT = Path(__file__).parents[1]
HEARD = "RISK_SAC_WALKS"  # names the file that the worker writes
# Functions during which a walk is recorded, in their thread.
WALKS = {
    "action": {"env/env.py": {"RiskSacEnv.step"}},
    "record": {
        "search/loop.py": {"tell"},
        "execution/recorder.py": {"Recorder.episode"},
        "execution/messages.py": {"hear"},
        "execution/scheduler.py": {"Scheduler._add_episodes"},
        "api/routes/episodes.py": {"list_episodes"},
        "client/client.py": {"Client._items"},
    },
    "spec": {
        "api/posted.py": {"_validated"},
        "api/routes/campaigns.py": {"_submit"},
        "execution/scheduler.py": {"Scheduler.fill"},
        "execution/worker.py": {"_execute"},
    },
}
END_OF_SPEC = "RiskSacEnv.reset"
BUILDS = "Problem.from_spec"
CONVERSIONS = {"to_json", "validate_json"}  # pydantic-core's


class Tracer(threading.local):
    """Profiler of one thread; what it sees is shared by all."""

    files: ClassVar[dict[str, dict[str, None]]] = {walk: {} for walk in WALKS}
    calls: ClassVar[dict[str, Counter[str]]] = {walk: Counter() for walk in WALKS}
    steps: ClassVar[Counter[tuple[str, ...]]] = Counter()
    walk: str | None = None
    first: FrameType | None = None
    importing: FrameType | None = None
    spec_ended = False

    def __call__(self, frame: FrameType, event: str, arg: Any) -> None:
        """See `sys.setprofile`."""
        if event == "call":
            self._call(frame, frame.f_code)
        elif event == "c_call" and self.walk and arg.__name__ in CONVERSIONS and not self.importing:
            self.calls[self.walk][f"{arg.__name__} of {_product_caller(frame)}"] += 1
        elif event == "return" and frame is self.first:
            if self.walk == "action":
                self.steps[tuple(self.files["action"])] += 1
                self.files["action"].clear()
            self.walk = self.first = None
        elif event == "return" and frame is self.importing:
            self.importing = None

    def _call(self, frame: FrameType, code: CodeType) -> None:
        name = code.co_filename
        if self.importing or not name.startswith((f"{ROOT}/risk_sac/", f"{ROOT}/service/")):
            return
        if code.co_name == "<module>":
            self.importing = frame
            return
        file = name.removeprefix(f"{ROOT}/")
        if self.walk == "spec" and code.co_qualname == END_OF_SPEC:
            self.walk, self.first, Tracer.spec_ended = None, None, True
        if self.walk is None:
            self.walk = next((w for w in WALKS if code.co_qualname in WALKS[w].get(file.partition("/")[2], ())), None)
            if self.walk == "spec" and Tracer.spec_ended:
                self.walk = None
            self.first = frame if self.walk else None
        if self.walk:
            self.files[self.walk].setdefault(file)
            if code.co_qualname == BUILDS:
                self.calls[self.walk][BUILDS] += 1


def _product_caller(frame: FrameType | None) -> str:
    while frame is not None and not frame.f_code.co_filename.startswith((f"{ROOT}/risk_sac/", f"{ROOT}/service/")):
        frame = frame.f_back
    return "?" if frame is None else f"{frame.f_code.co_filename.removeprefix(f'{ROOT}/')}: {frame.f_code.co_qualname}"


def work() -> None:
    """Execute one run as the worker does, traced."""
    from risk_sac.execution import worker

    status = worker.main()
    sys.setprofile(None)
    files = Tracer.files | {"action": Tracer.steps.most_common(1)[0][0]}
    calls = {walk: dict(counts) for walk, counts in Tracer.calls.items()}
    Path(os.environ[HEARD]).write_text(json.dumps([{walk: list(files[walk]) for walk in files}, calls]))
    os._exit(status)


def play(folder: Path) -> None:
    """Posts a campaign of one short run, awaits it, reads its episodes."""
    settings = ServiceSettings(data_dir=folder / "data", worker_module="tests.walks", replays=0, lease_s=60.0)
    port = free_port()
    server = uvicorn.Server(uvicorn.Config(create_app(settings), port=port, log_level="error"))
    thread = threading.Thread(target=server.run)
    thread.start()
    with Client(f"http://127.0.0.1:{port}", patience_s=60.0) as client:
        budget = Budget(episodes=2)
        spec = CampaignSpec(families=["low"], methods=["random"], seeds=[0], budget=budget)
        campaign = client.submit(spec)
        while not client.campaign(campaign.id).state.final:
            time.sleep(0.5)
        httpx.get(f"{client.url}/v1/campaigns/{campaign.id}/episodes").raise_for_status()
        list(client.failures(campaign.id))  # the client reads no other episodes
    server.should_exit = True
    thread.join()


def main() -> None:
    """Print the files and the conversions of each walk."""
    with tempfile.TemporaryDirectory() as name:
        heard = Path(name, "worker.json")
        os.environ[HEARD] = str(heard)
        play(Path(name))
        sys.setprofile(None)
        threading.setprofile(None)
        files, calls = json.loads(heard.read_text())
    for walk in WALKS:
        both = list(dict.fromkeys([*Tracer.files[walk], *files[walk]]))
        rooms = dict.fromkeys("/".join(file.split("/")[:2]) for file in both)
        print(f"\n{walk}: {len(both)} files in {len(rooms)} rooms: {', '.join(rooms)}")
        for file in both:
            print(f"  {file}")
        for call, count in [*Tracer.calls[walk].items(), *calls[walk].items()]:
            print(f"  {count} x {call}")


if __name__ == "__main__":
    tracer = Tracer()
    threading.setprofile(tracer)
    sys.setprofile(tracer)
    work() if len(sys.argv) > 1 else main()
