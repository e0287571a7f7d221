"""Signs a report by the digests of all its inputs, and finds inputs that changed since.

A manifest has a line `sha256  name` for each input, as `sha256sum` writes them; the report's digest is that of its
lines. An unkeyed digest shows that inputs are as they were. It does not show who wrote the report.
"""

import contextlib
import hashlib
import html
import json
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

from risk_sac.config import CampaignSpec
from risk_sac.errors import ConfigError
from risk_sac.records.assessment import InputDigest, SignedInputs
from risk_sac.report.power import MEASURED
from risk_sac.run_folder.results import EPISODES, FAILURES, RESULTS, VERIFIED
from risk_sac.scenario.families import sources_named

FILES = (RESULTS, EPISODES, VERIFIED)
FOLDERS = (FAILURES, "studies")  # one line for all files of each
_LINE = re.compile(r"^([0-9a-f]{64})  (\S+)$", re.MULTILINE)
_TAG = re.compile(r"<[^>]*>")


def signed(digests: Mapping[str, str]) -> SignedInputs:
    """Signs inputs: name → SHA-256."""
    inputs = tuple(InputDigest(name=name, sha256=digests[name]) for name in sorted(digests))
    return SignedInputs(digest=sha256(manifest(inputs).encode()), inputs=inputs)


def manifest(inputs: Iterable[InputDigest]) -> str:
    """Writes the lines that a digest is formed over."""
    return "".join(f"{one.sha256}  {one.name}\n" for one in inputs)


def sha256(content: bytes) -> str:
    """Returns the SHA-256 of some bytes in hexadecimal digits."""
    return hashlib.sha256(content).hexdigest()


def input_digests(
    spec: CampaignSpec, folders: Iterable[Path], *, code: str = "", regression: str = ""
) -> Mapping[str, str]:
    """Digests the inputs of a report.

    Args:
      spec: of the campaign.
      folders: of its runs; files that are not there have no line.
      code: SHA-256 over the sources that make the report; no line if empty.
      regression: JSON of the regression in it; no line if empty.

    Returns:
      Name → SHA-256.
    """
    digests = {"campaign": spec.digest, "benchmark": sha256(MEASURED.read_bytes())}
    digests |= {"code": code} if code else {}
    digests |= {"regression": sha256(regression.encode())} if regression else {}
    for name in spec.families:
        try:
            digests |= {f"scenarios/{name}/{file}": sha256(content) for file, content in sources_named(name).items()}
        except (ConfigError, OSError):
            continue  # a lost scenario is named in the report
    for folder in folders:
        digests |= dict(_of_run(folder))
    return digests


def _of_run(folder: Path) -> Iterator[tuple[str, str]]:
    for name in FILES:
        if (folder / name).is_file():
            yield f"{folder.name}/{name}", sha256((folder / name).read_bytes())
    for name in FOLDERS:
        files = sorted(path for path in (folder / name).glob("**/*") if path.is_file())
        if files:
            lines = [f"{sha256(path.read_bytes())}  {path.relative_to(folder)}\n" for path in files]
            yield f"{folder.name}/{name}/", sha256("".join(lines).encode())


def inputs_in(text: str) -> SignedInputs:
    """Reads the manifest of a report: JSON, HTML or Markdown.

    Raises:
      ConfigError: the text has no manifest, or its lines are not those that the report's digest was formed over.
    """
    wanted: SignedInputs | None = None
    if text.lstrip().startswith("{"):
        with contextlib.suppress(ValueError):  # no JSON, or no report's: a ValidationError is one, too
            wanted = SignedInputs.model_validate(json.loads(text).get("signed"))
    else:
        if text.lstrip().startswith("<!doctype"):
            text = html.unescape(_TAG.sub("", text))
        lines = {name: digest for digest, name in _LINE.findall(text)}
        stated = re.search(r"digest of all inputs\W*([0-9a-f]{64})", text)
        if lines and stated:
            made = signed(lines)
            wanted = made.model_copy(update={"digest": stated[1]})
    if wanted is None:
        raise ConfigError("REPORT", "a file without the inputs of a report", "a report of `risk-sac report`")
    if signed({one.name: one.sha256 for one in wanted.inputs}).digest != wanted.digest:
        raise ConfigError("REPORT", "a digest that its own list of inputs does not give", "an unchanged report")
    return wanted


def changes(report: SignedInputs, now: SignedInputs) -> Sequence[str]:
    """Names the inputs that changed since a report, are missing or are new; empty if none."""
    before, after = ({one.name: one.sha256 for one in inputs.inputs} for inputs in (report, now))
    words = []
    for name in sorted(before.keys() | after.keys()):
        if before.get(name) != after.get(name):
            words.append(f"{name} ({'new' if name not in before else 'missing' if name not in after else 'changed'})")
    return words
