import re
import shlex
import tomllib
from pathlib import Path

import pytest
import yaml

from service.settings import ServiceSettings, with_table

ROOT = Path(__file__).parents[2]
SETTINGS = (ROOT / "service" / "settings.md").read_text(encoding="utf-8")
DOCKERFILE = (ROOT / "docker" / "Dockerfile").read_text(encoding="utf-8")
COMPOSE = (ROOT / "docker" / "compose.yaml").read_text(encoding="utf-8")
KUBERAY = (ROOT / "docker" / "kuberay.yaml").read_text(encoding="utf-8")
# No setting of the service: a shell's own, which name the image, what is published and where secrets lie.
OTHERS = {
    "RISK_SAC_SECRETS_DIR",
    "RISK_SAC_API_KEY_FILE",
    "RISK_SAC_IMAGE",
    "RISK_SAC_MEMORY",
    "RISK_SAC_PUBLISHED_PORT",
    "RISK_SAC_WITHOUT_PAGE",  # of the installation: the page has been built before
}


@pytest.fixture
def compose():
    return yaml.safe_load(COMPOSE)["services"]


def test_table_of_settings_is_what_the_settings_generate():
    assert with_table(SETTINGS) == SETTINGS, "run `make settings`"


def test_containers_set_no_variable_that_is_none():
    known = {f"RISK_SAC_{name.upper()}" for name in ServiceSettings.model_fields} | OTHERS
    workflow = (ROOT / "docker" / "workflow.yaml").read_text(encoding="utf-8")
    assert set(re.findall(r"RISK_SAC_\w+", DOCKERFILE + COMPOSE + KUBERAY + workflow)) <= known


def test_service_of_the_compose_file_gets_its_secrets_as_settings(compose):
    for secret in compose["service-postgres"]["secrets"]:
        assert secret.removeprefix("risk_sac_") in ServiceSettings.model_fields


@pytest.mark.parametrize("name", ["service", "service-postgres"])
def test_service_of_the_compose_file_is_confined(compose, name):
    service = compose[name]
    assert service["read_only"] is True
    assert service["cap_drop"] == ["ALL"]
    assert service["security_opt"] == ["no-new-privileges:true"]
    assert service["deploy"]["resources"]["limits"].keys() == {"cpus", "memory", "pids"}
    assert all(port.startswith("127.0.0.1:") for port in service["ports"])


def test_compose_file_waits_longer_than_the_server_takes_to_stop(compose):
    stop_s = ServiceSettings.model_fields["stop_s"].default
    assert float(compose["service"]["stop_grace_period"].removesuffix("s")) > stop_s


def test_build_context_has_all_that_the_image_is_built_of():
    ignored = (ROOT / ".dockerignore").read_text(encoding="utf-8").splitlines()
    allowed = {line.removeprefix("!") for line in ignored if line.startswith("!")}
    copied = {
        source for line in re.findall(r"^COPY (?!--from)(.+)$", DOCKERFILE, re.M) for source in shlex.split(line)[:-1]
    }
    assert {Path(source).parts[0] for source in copied} == allowed
    assert all((ROOT / source).exists() for source in copied)


def test_workflow_cleans_up_whatever_came_of_the_campaign():
    steps = yaml.safe_load((ROOT / "docker" / "workflow.yaml").read_text())["jobs"]["falsification"]["steps"]
    always = [step["name"] for step in steps if step.get("if") == "always()" and "run" in step]
    assert always == ["Keep what was found", "Stop the service"]


@pytest.fixture
def manifest():
    return {each["kind"]: each for each in yaml.safe_load_all(KUBERAY)}


def test_manifest_for_kuberay_has_the_version_of_ray_that_the_image_installs(manifest):
    spec = manifest["RayCluster"]["spec"]
    (extra,) = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]["ray"]
    assert extra == f"ray=={spec['rayVersion'].rpartition('.')[0]}.*"


def test_all_pods_of_the_manifest_want_a_token_and_are_of_one_image(manifest):
    spec = manifest["RayCluster"]["spec"]
    pods = [spec["headGroupSpec"]["template"], *(group["template"] for group in spec["workerGroupSpecs"])]
    pods.append(manifest["Deployment"]["spec"]["template"])
    containers = [container for pod in pods for container in pod["spec"]["containers"]]
    assert len(containers) == 3
    assert {container["image"] for container in containers} == {"localhost/risk-sac"}
    for container in containers:
        environment = {each["name"]: each for each in container["env"]}
        assert environment["RAY_AUTH_MODE"]["value"] == "token"
        assert environment["RAY_AUTH_TOKEN"]["valueFrom"]["secretKeyRef"] == {"name": "ray-token", "key": "token"}


def test_compose_has_a_cluster_of_a_head_and_two_workers_that_want_a_token(compose):
    ray = {name: each for name, each in compose.items() if each.get("profiles") == ["ray"]}
    assert set(ray) == {"service-ray", "ray-head", "ray-worker-1", "ray-worker-2"}
    for each in ray.values():
        assert each["environment"]["RAY_AUTH_MODE"] == "token"
        assert each["environment"]["RAY_AUTH_TOKEN_PATH"] == "/run/secrets/ray_token"
        assert "ray_token" in each["secrets"]
    assert ray["service-ray"]["environment"]["RISK_SAC_EXECUTOR"] == "ray"
