"""Settings of the server: environment variables or files of secrets."""

import json
import os
import re
import sys
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, Field, FilePath, ValidationError
from pydantic_core import ErrorDetails, from_json
from pydantic_settings import BaseSettings, NoDecode, SettingsConfigDict

from risk_sac.config.campaign import plain_url
from risk_sac.errors import ConfigError
from risk_sac.execution import ExecutorName
from risk_sac.execution.ray import RaySettings
from risk_sac.host.machine import cores
from risk_sac.run_folder.results import TIMES

MOST_WORKERS = 1024
ROOT_PATH = re.compile(r"^(/[A-Za-z0-9._~-]{1,100}){0,10}$")
SECRETS = os.environ.get("RISK_SAC_SECRETS_DIR")


def _parsed(value: object) -> object:
    return from_json(value) if isinstance(value, str) else value


# Parsed here: pydantic-settings would report invalid JSON before it checks any other setting.
Names = Annotated[list[str], NoDecode, BeforeValidator(_parsed)]


AllowedUrl = Annotated[str, AfterValidator(plain_url), Field(json_schema_extra={"format": "url"})]
Urls = Annotated[list[AllowedUrl], NoDecode, BeforeValidator(_parsed)]


def _rooted(path: object) -> object:
    """`sim/` -> `/sim`; `/` -> nothing."""
    return f"/{path.strip('/')}".rstrip("/") if isinstance(path, str) else path


def _most_workers(given: dict[str, Any]) -> int:
    return MOST_WORKERS if given.get("executor") == "ray" else cores()


class ServiceSettings(RaySettings, BaseSettings):
    """Settings of the server: addresses, resources, access and time limits."""

    model_config = SettingsConfigDict(
        env_prefix="RISK_SAC_", frozen=True, use_attribute_docstrings=True, secrets_dir=SECRETS
    )

    data_dir: Annotated[Path, AfterValidator(Path.absolute)] = Field(default=Path("data"), validate_default=True)
    """Folder of the database, checkpoints, recorded failures, API keys and uploaded networks."""
    runs: Path | None = None
    """Folder of runs of the command line that are imported after the start, as campaigns that have ended."""
    database_url: str | None = None
    """SQLAlchemy URL of a PostgreSQL database (`postgresql+psycopg://…`); by default SQLite in `data_dir`."""
    host: str = "127.0.0.1"
    """Address to listen on; any but loopback is refused until an API key exists."""
    port: Annotated[int, Field(ge=1, le=65535)] = 8000
    """TCP port to listen on."""
    log_format: Literal["text", "json"] = "text"
    """Format of the log; `json` has one object per line with campaign and run ids as fields."""

    egos: FilePath | None = None
    """TOML file that registers egos in processes of their own, see `risk_sac/egos/remote/README.md`."""

    executor: ExecutorName = "local"
    """Executor of runs; `local`: processes of this machine; `ray`: a cluster."""
    max_workers: Annotated[int, Field(ge=1, le=MOST_WORKERS)] = Field(default_factory=_most_workers)
    """Processes that play episodes at the same time, at least one for each run; by default one per core, or as many as
    fit the cluster. A run in rounds takes up to `budget.batch` of those that are free, within its project's share."""
    worker_module: str = "risk_sac.execution.worker"
    """Module that executes one run, started as `python -m`."""
    worker_niceness: Annotated[int, Field(ge=0, le=19)] = 5
    """Added to the niceness of workers."""
    worker_memory_bytes: Annotated[int, Field(ge=1 << 28)] = 4 << 30
    """Memory that a worker, and each process that plays its episodes, may take, bytes; a run that needs more fails."""
    grace_s: Annotated[float, Field(gt=0, le=600)] = 30.0
    """Time that a worker whose run is cancelled has to finish its episode before it is killed, s."""
    stop_s: Annotated[float, Field(gt=0, le=600)] = 15.0
    """Time that a worker has to write a checkpoint when the server stops, s."""
    lease_s: Annotated[float, Field(gt=0, le=600)] = 4.0
    """Time without a message or processor use after which a worker is killed and its run resumed, s."""
    stall_s: Annotated[float, Field(gt=0, le=86400)] = 600.0
    """Time without a finished episode after which a worker is killed and its run resumed, s."""
    attempts: Annotated[int, Field(ge=1, le=100)] = 5
    """Workers of one run that may die in a row without a finished episode before the run fails."""

    replays: Annotated[int, Field(ge=0, le=10)] = TIMES
    """Replays of each distinct failure of a finished run, in fresh processes; 0 for none."""

    on_end: Urls = []
    """URLs that `on_end` of a campaign may be or lie below, a JSON list such as `["https://hooks.example/ci"]`; by
    default none. Messages go there directly, past proxies."""

    retention_days: Annotated[float, Field(gt=0)] | None = None
    """Age in days at which ended campaigns are deleted with their files; by default never."""

    allowed_hosts: Names = ["localhost", "127.0.0.1", "[::1]"]
    """Accepted Host headers, a JSON list; `*` accepts all. The listening address is always accepted."""
    root_path: Annotated[str, BeforeValidator(_rooted), Field(pattern=ROOT_PATH)] = ""
    """Path of the service behind a proxy that strips it, such as `/sim`."""
    trusted_proxies: Names = []
    """Addresses of proxies whose `X-Forwarded-For` and `X-Forwarded-Proto` are trusted, a JSON list."""
    cors_origins: Names = []
    """Origins whose web pages may call the service, a JSON list."""
    max_connections: Annotated[int, Field(ge=1)] | None = None
    """Connections open at the same time; by default, and at most, what the limit of open files allows."""
    head_timeout_s: Annotated[float, Field(gt=0, le=600)] = 10.0
    """Time for the head of the next request on a connection, s."""
    max_body_bytes: Annotated[int, Field(ge=1024)] = 1 << 20
    """Largest body of a request other than an upload, bytes."""
    max_upload_bytes: Annotated[int, Field(ge=1024)] = 32 << 20
    """Largest upload, bytes."""
    min_body_rate: Annotated[int, Field(ge=1)] = 1024
    """Least average rate of a body, bytes per second."""
    body_patience_s: Annotated[float, Field(gt=0, le=600)] = 5.0
    """Time that a body may arrive more slowly than that, s."""
    rate_limit: Annotated[int, Field(ge=1)] = 500
    """Requests per second that one key, or one address without a key, may make."""
    quota_queued_runs: Annotated[int, Field(ge=1)] = 10_000
    """Queued runs that one project may have."""
    quota_cpu_hours: Annotated[float, Field(gt=0)] | None = None
    """Worker hours that one project may use in 24 hours; by default unlimited."""

    @property
    def url(self) -> str:
        """SQLAlchemy URL of the database."""
        return self.database_url or f"sqlite:///{self.data_dir / 'risk-sac.db'}"

    @property
    def keys_file(self) -> Path:
        """Hashes of the API keys."""
        return self.data_dir / "keys.json"

    @property
    def places_dir(self) -> Path:
        """Places of networks that campaigns have been run at."""
        return self.data_dir / "places"

    @property
    def networks_dir(self) -> Path:
        """Uploaded road networks."""
        return self.data_dir / "networks"

    @property
    def scenarios_dir(self) -> Path:
        """Records of the scenarios that projects have posted."""
        return self.data_dir / "scenarios"

    def campaign_folder(self, campaign_id: str) -> Path:
        """Folder of one campaign's files."""
        return self.data_dir / "campaigns" / campaign_id

    def run_folder(self, campaign_id: str, run_id: str) -> Path:
        """Folder of a run's results, recorded failures, checkpoint and log."""
        return self.campaign_folder(campaign_id) / run_id


MISUSED = 2  # exit status of a command whose settings are wrong, as of `risk-sac`
LONGEST_VALUE = 80
BEGIN = "<!-- settings: written by `make settings` -->"
END = "<!-- /settings -->"
BOUNDS = {"minimum": "≥", "exclusiveMinimum": ">", "maximum": "≤"}
TYPES = {"array": "JSON list", "url": "http or https URL", "path": "folder", "file-path": "file", "string": "text"}


def read_settings() -> ServiceSettings:
    """The settings of this process.

    Raises:
      ConfigError: some are wrong, one line each; or the folder of secrets is missing, or cannot be read.
    """
    _check_secrets()
    try:
        return ServiceSettings()
    except ValidationError as error:
        # A default that depends on other settings is not wrong because they are.
        wrong = [each for each in error.errors() if each["type"] != "default_factory_not_called"]
        raise ConfigError("", "\n".join(dict.fromkeys(map(_line, wrong)))) from error
    except OSError as error:
        raise ConfigError("", f"secret {error.filename!r} cannot be read ({error.strerror})") from error


def _check_secrets() -> None:
    if SECRETS and not Path(SECRETS).is_dir():
        what = "no folder" if os.path.lexists(SECRETS) else "missing"
        name = _variable("secrets_dir")
        raise ConfigError(name, f"{SECRETS!r}, which is {what}", "a folder that has settings as files")


def _line(error: ErrorDetails) -> str:
    name, *item = error["loc"]
    field = ServiceSettings.model_json_schema()["properties"][name]
    text = repr(error["input"])
    shown = text if len(text) <= LONGEST_VALUE else f"{text[:LONGEST_VALUE]}…"
    return str(ConfigError(_variable(str(name)), shown, takes(field["items"] if item else field)))


def _variable(name: str) -> str:
    return f"{ServiceSettings.model_config['env_prefix']}{name.upper()}"


def table() -> str:
    """Returns the settings as a Markdown table."""
    settings = ServiceSettings.model_json_schema()["properties"]
    rows = [
        f"| `{_variable(name)}` | {takes(field)} | {_default(field)} | {' '.join(field['description'].split())} |"
        for name, field in sorted(settings.items(), key=lambda setting: setting[0].startswith("ray_"))  # they come last
    ]
    return "\n".join(["| variable | takes | default | meaning |", "|---|---|---|---|", *rows])


def with_table(text: str) -> str:
    """The text with the table between its two marks."""
    before, begin, rest = text.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not end:
        raise ValueError(f"the text lacks {BEGIN!r} or, behind it, {END!r}; put both where the table belongs")
    return f"{before}{begin}\n{table()}\n{end}{after}"


def takes(field: dict[str, Any]) -> str:
    """Returns what a setting takes, by its JSON schema."""
    if "anyOf" in field:  # one of them is null, which is what no variable means
        return next(takes(each) for each in field["anyOf"] if each["type"] != "null")
    if "const" in field:
        return f"`{field['const']}`"
    if "enum" in field:
        return " or ".join(f"`{each}`" for each in field["enum"])
    bounds = ", ".join(f"{sign} {field[name]:g}" for name, sign in BOUNDS.items() if name in field)
    kind = field.get("format", field["type"])
    return f"{TYPES.get(kind, kind)} {bounds}".strip()


def _default(field: dict[str, Any]) -> str:
    """Returns a field's default as users write it, a dash for none."""
    default = field.get("default")
    if default is None:
        return "–"
    return f"`{json.dumps(default) if isinstance(default, list) else default}`"


if __name__ == "__main__":
    page = Path(sys.argv[1] if len(sys.argv) > 1 else "service/settings.md")
    page.write_text(with_table(page.read_text(encoding="utf-8")), encoding="utf-8")
