"""The example workflow, step by step, as its CI would execute it."""

import os
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import yaml

from smoke_test.errors import SmokeError

STEP_S = 300.0


@dataclass(frozen=True)
class Step:
    """A script of the workflow."""

    name: str
    script: str

    def run(self, folder: Path, environment: Mapping[str, str], status: int = 0) -> None:
        """Executes the script in a folder.

        Raises:
          SmokeError: it ends with another status than the wanted one.
        """
        result = subprocess.run(
            ["bash", "-e", "-c", self.script],
            cwd=folder,
            env=os.environ | environment,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=STEP_S,
            check=False,
        )
        if result.returncode != status:
            said = (result.stderr or result.stdout).strip()[-2000:]
            raise SmokeError(f"step {self.name!r} ended with {result.returncode}, wanted {status}: {said}")


@dataclass(frozen=True)
class Workflow:
    """What comes before the campaign, the campaign, and what is done whatever came of it."""

    environment: Mapping[str, str]
    before: tuple[Step, ...]
    campaign: Step
    afterwards: tuple[Step, ...]
    artefacts: str
    """Folder that is kept."""

    @classmethod
    def load(cls, file: Path) -> "Workflow":
        """Reads a workflow of one job, with one step of the id `campaign`."""
        document = yaml.safe_load(file.read_text(encoding="utf-8"))
        (job,) = document["jobs"].values()
        steps = job["steps"]
        at = next(number for number, step in enumerate(steps) if step.get("id") == "campaign")
        return cls(
            environment={name: str(value) for name, value in document["env"].items()},
            before=_scripts(steps[:at]),
            campaign=_scripts(steps[at : at + 1])[0],
            afterwards=_scripts(step for step in steps[at + 1 :] if step.get("if") == "always()"),
            artefacts=next(step["with"]["path"] for step in steps if "upload-artifact" in step.get("uses", "")),
        )


def _scripts(steps: object) -> tuple[Step, ...]:
    return tuple(Step(step["name"], step["run"]) for step in steps if "run" in step)  # type: ignore[attr-defined]
