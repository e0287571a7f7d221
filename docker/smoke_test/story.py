"""What is done with the image: the example workflow, and in its middle campaigns that outlive a killed container."""

import contextlib
import json
import re
import shutil
import socket
import time
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from typing import Any

import yaml

from smoke_test.api import Api
from smoke_test.engines import HERE, Engine
from smoke_test.errors import SmokeError
from smoke_test.image import IMAGE
from smoke_test.namespaces import own_network
from smoke_test.workflow import Workflow

CONTAINER = "risk-sac"  # as the workflow calls it
IMAGE_BYTES = 1_600_000_000
FAMILIES = ("low", "mixed", "dense")
EPISODES = 40  # of each family: few enough for minutes, enough to be killed amid
KILLED_AFTER = 20  # episodes of all of them
READY_S = 60.0
CAMPAIGNS_S = 400.0  # a fraction of it, unless the machine is busy with something else
STOP_S = 30.0


class Story:
    """One pass through everything; each step raises a SmokeError where it is not as it should be."""

    def __init__(self, engine: Engine, folder: Path) -> None:
        self._engine = engine
        self._workflow = Workflow.load(HERE / "workflow.yaml")
        self._document = yaml.safe_load((HERE.parent / "openapi.yaml").read_text(encoding="utf-8"))
        self._workspace = folder / "workspace"
        self._workspace.mkdir()
        shutil.copy(HERE / "campaign.yaml", self._workspace / self._workflow.environment["SPEC"])
        if engine.private:
            own_network()
        self._port = self._workflow.environment["PORT"] if engine.private else _free_port()
        self._key_file = folder / "risk-sac-key"
        given = {"ENGINE": engine.program, "IMAGE": IMAGE, "PORT": self._port, "RUNNER_TEMP": str(folder)}
        self._environment = {**self._workflow.environment, **engine.environment, **given}

    def told(self) -> str:
        """What was seen.

        Raises:
          SmokeError: something else was.
        """
        size = self._size()
        _say(f"the image has {size / 1e9:.2f} GB")
        try:
            for step in self._workflow.before:
                step.run(self._workspace, self._environment)
            self._api = Api(f"http://127.0.0.1:{self._port}", self._key_file.read_text().strip(), self._document)
            self._check_container()
            episodes, kept = self._campaigns()
            self._gate()
            self._stop()
        except Exception:
            _say(f"the container's log ends with:\n{self._log()}")
            raise
        finally:
            self._clean_up()
        enforced = "a read-only root" if self._engine.read_only else "a root that chroot isolation leaves writable"
        return (
            f"{self._engine.name}, image {size / 1e9:.2f} GB with {enforced}; {episodes} episodes of {len(FAMILIES)} "
            f"families, {kept} of them from before the container was killed; the gate passes and fails"
        )

    def _size(self) -> int:
        listed = self._engine("run", "--rm", "--user", "0", "--entrypoint", "du", IMAGE, "-sbx", "/")
        size = int(listed.split()[0])
        if size >= IMAGE_BYTES:
            raise SmokeError(f"the image has {size / 1e9:.2f} GB; wanted less than {IMAGE_BYTES / 1e9} GB")
        return size

    def _check_container(self) -> None:
        """Health check, user, file system, and that nobody gets in without a key."""
        self._api.wait_ready(READY_S)
        Api(f"http://127.0.0.1:{self._port}", None, self._document).get("/v1/campaigns", status=401)
        self._engine("exec", CONTAINER, *_health_check())
        user = self._engine("exec", CONTAINER, "id", "-u")
        if user != "10001":
            raise SmokeError(f"the container runs as user {user}; wanted 10001")
        if (
            self._engine.read_only
            and self._engine.attempt("exec", "--user", "0", CONTAINER, "touch", "/x").returncode == 0
        ):
            raise SmokeError("root can write into /; wanted a read-only root file system")

    def _campaigns(self) -> tuple[int, int]:
        """One campaign per family, with the container killed and started again in between.

        Returns:
          Episodes, and how many of them are from before.
        """
        budget = {"episodes": EPISODES}
        posted = [
            self._api.post("/v1/campaigns", {"label": "smoke", "families": [family], "budget": budget}, status=202)[
                "id"
            ]
            for family in FAMILIES
        ]
        self._wait(posted, "to be amid them", lambda campaigns: _done(campaigns) >= KILLED_AFTER)
        before = {each: self._episodes(each) for each in posted}
        _say(f"{sum(map(len, before.values()))} episodes; the container is killed and started again")
        self._engine("kill", "--signal", "KILL", CONTAINER)
        self._engine("start", CONTAINER)
        self._api.wait_ready(READY_S)
        self._wait(posted, "to end", lambda campaigns: all(_ended(each) for each in campaigns))
        for each in posted:
            self._check_campaign(each, before[each])
        return EPISODES * len(posted), sum(map(len, before.values()))

    def _wait(self, ids: list[str], what: str, reached: Any) -> None:
        end = time.monotonic() + CAMPAIGNS_S
        while not reached(
            campaigns := [self._api.get("/v1/campaigns/{campaign_id}", campaign_id=each) for each in ids]
        ):
            if time.monotonic() > end:
                raise SmokeError(
                    f"waited {CAMPAIGNS_S:.0f} s for the campaigns {what}: {_done(campaigns)} episodes are done"
                )
            time.sleep(0.5)

    def _check_campaign(self, campaign_id: str, before: dict[str, Any]) -> None:
        campaign = self._api.get("/v1/campaigns/{campaign_id}", campaign_id=campaign_id)
        results = self._api.get("/v1/campaigns/{campaign_id}/results", campaign_id=campaign_id)
        list(self._api.all("/v1/campaigns/{campaign_id}/failures", campaign_id=campaign_id))
        if campaign["state"] != "succeeded" or not results["complete"]:
            raise SmokeError(f"campaign {campaign_id} is {campaign['state']}: {campaign['reason']}")
        after = self._episodes(campaign_id)
        if len(after) != EPISODES:
            raise SmokeError(f"campaign {campaign_id} has {len(after)} episodes; wanted {EPISODES}")
        lost = [each for each, episode in before.items() if after.get(each) != episode]
        if lost:
            first = {"before": before[lost[0]], "after": after.get(lost[0])}
            message = f"campaign {campaign_id} no longer has the episodes {lost} from before the container was killed"
            raise SmokeError(f"{message}: {first}")

    def _episodes(self, campaign_id: str) -> dict[str, Any]:
        """By id and without what only the end of their run adds to them."""
        found = self._api.all("/v1/campaigns/{campaign_id}/episodes", campaign_id=campaign_id)
        return {each["id"]: each | {"repetition": None} for each in found}

    def _gate(self) -> None:
        """The workflow's campaign below its threshold and above it, and what is kept of it."""
        self._workflow.campaign.run(self._workspace, self._environment | {"MAX_ECR": "1", "MAX_PCR": "1"})
        self._workflow.campaign.run(self._workspace, self._environment | {"MAX_ECR": "0.001", "MAX_PCR": "1"}, status=1)
        keep = self._workflow.afterwards[0]
        keep.run(self._workspace, self._environment)
        artefacts = self._workspace / self._workflow.artefacts
        report = ElementTree.parse(artefacts / "risk-sac.xml").getroot()
        if report.get("failures") == "0":
            raise SmokeError("the JUnit file of a campaign above its threshold shows no failure")
        campaign_id = json.loads((artefacts / "results.json").read_text())["campaign_id"]
        if not any((artefacts / "campaigns" / campaign_id).rglob("*.npz")):
            raise SmokeError(f"no failure of campaign {campaign_id} was kept")

    def _stop(self) -> None:
        """SIGTERM ends the server, not the time that an engine waits before it kills."""
        start = time.monotonic()
        self._engine("stop", "-t", f"{STOP_S:.0f}", CONTAINER)
        if time.monotonic() - start >= STOP_S or "shutdown complete" not in self._log():
            raise SmokeError(f"the server did not heed SIGTERM within {STOP_S:.0f} s")

    def _log(self) -> str:
        result = self._engine.attempt("logs", CONTAINER)
        lines = (result.stdout + result.stderr).splitlines()
        return "\n".join([line for line in lines if "service.access" not in line][-20:])

    def _clean_up(self) -> None:
        """The workflow's own last step, and what it would leave of a start that failed halfway."""
        with contextlib.suppress(SmokeError):
            self._workflow.afterwards[-1].run(self._workspace, self._environment)
        self._engine.attempt("rm", "--force", CONTAINER)
        self._engine.attempt("volume", "rm", CONTAINER)


def _done(campaigns: list[dict[str, Any]]) -> int:
    return sum(each["progress"]["episodes_done"] for each in campaigns)


def _ended(campaign: dict[str, Any]) -> bool:
    return campaign["state"] in ("succeeded", "failed", "cancelled")


def _health_check() -> list[str]:
    """The image's own, which not every engine keeps or runs."""
    dockerfile = (HERE / "Dockerfile").read_text().replace("\\\n", "")
    command: list[str] = json.loads(re.findall(r"^HEALTHCHECK .* CMD (\[.*\])$", dockerfile, re.M)[0])
    return command


def _free_port() -> str:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return str(probe.getsockname()[1])


def _say(line: str) -> None:
    print(f"smoke: {line}")
