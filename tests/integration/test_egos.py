"""Registered egos in real episodes: in this process, another, and failing."""

import gc
import json
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from risk_sac import cli
from risk_sac.config import Budget, EgoConfig, RunSpec
from risk_sac.egos.registry import card_of, cards, pinned
from risk_sac.env.env import RiskSacEnv
from risk_sac.env.problem import Problem
from risk_sac.errors import CheckpointError, ConfigError, InfeasibleScene
from risk_sac.execution.evaluate import run, verify
from risk_sac.records import EpisodeRecord, Outcome
from risk_sac.run_folder.results import RunResults
from risk_sac.search.processes import processes_of
from risk_sac.world.types import Frame
from tests.ego_processes import CPP_COMPILES, served, served_by_cpp

EXAMPLE = '''
from risk_sac.egos import Control
from risk_sac.egos.driving import lane_keeping

class Example:
    """{summary}"""

    version = "{version}"
    response_time_s = 0.4

    def reset(self, episode):
        self.vehicle, self.steps = episode.vehicle, 0

    def act(self, perceived):
        self.steps += 1
        {body}
        return Control(0.0, lane_keeping(perceived, self.vehicle))

    def close(self):
        raise RuntimeError("the device is gone")  # which is no end of a run
'''


@pytest.fixture
def install(tmp_path, monkeypatch):
    """Installs a package with an ego: a distribution with an entry point."""
    monkeypatch.syspath_prepend(str(tmp_path))

    def installed(body: str = "pass", version: str = "1", summary: str = "An example.") -> None:
        sys.modules.pop("example_ego", None)
        (tmp_path / "example_ego.py").write_text(EXAMPLE.format(body=body, version=version, summary=summary))
        info = tmp_path / "example_ego-1.dist-info"
        info.mkdir(exist_ok=True)
        (info / "METADATA").write_text("Metadata-Version: 2.1\nName: example-ego\nVersion: 1\n")
        (info / "entry_points.txt").write_text("[risk_sac.egos]\nexample = example_ego:Example\n")

    return installed


def checked(capsys, ego: str, *scenarios: str) -> tuple[int, dict[str, Any]]:
    status = cli.main(["egos", "check", ego, "--scenario", *scenarios, "--json"])
    return status, json.loads(capsys.readouterr().out)


def test_a_check_of_a_sound_ego_draws_its_ways(tmp_path, capsys):
    assert cli.main(["egos", "check", "idm-aeb", "--scenario", "low", "--out", str(tmp_path / "out")]) == 0
    assert "It is fit for a search." in capsys.readouterr().out
    assert (tmp_path / "out" / "low.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("body", "scenario", "reason"),
    [
        ("raise ValueError('no map')", "low", "low: the ego crashed: ValueError: no map"),
        ("return Control(-20.0, 0.0)", "low", "it stands throughout the second half of every scene"),
        ("return Control(2.6, lane_keeping(perceived, self.vehicle))", "cyclist_ahead", "cyclist_ahead: it touches "),
    ],
)
def test_a_check_tells_why_an_ego_is_unusable(install, capsys, body, scenario, reason):
    install(body)
    status, answer = checked(capsys, "example", scenario)
    assert status == 1
    assert answer["unusable"][0].startswith(reason)
    (trial,) = answer["trials"]
    assert bool(trial["clipped"]) == ("-20" in body)


def test_a_check_counts_late_decisions_and_refuses_the_driver_of_sumo(install, capsys):
    install("self.steps < 5 and __import__('time').sleep(0.11)")
    _, answer = checked(capsys, "example", "low")
    assert answer["trials"][0]["late"] >= 3
    assert answer["trials"][0]["worst_ratio"] > 1.1
    assert cli.main(["egos", "check", "careful"]) == 2
    assert "ego: got 'careful', which SUMO drives; wanted a registered ego" in capsys.readouterr().err


def test_what_an_ego_prints_spoils_no_replay(install, tmp_path, monkeypatch):
    install("print('hello', flush=True); __import__('os').write(1, b'{}')")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))  # of the helper process
    play(spec_of("example"), tmp_path / "run")
    (verified,) = verify([tmp_path / "run"], times=2).values()
    assert verified.episodes
    assert not verified.flaky


def test_an_ego_that_interrupts_its_worker_has_crashed(install, tmp_path, monkeypatch):
    install("raise KeyboardInterrupt")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))  # of the worker
    flags = "--scenario low --methods random --seeds 1 --episodes 3 --ego example --out"
    assert cli.main(["evaluate", *flags.split(), str(tmp_path / "out")]) == 0
    (lines,) = (tmp_path / "out" / "runs").glob("*/episodes.jsonl")
    records = [EpisodeRecord.model_validate_json(line) for line in lines.read_bytes().splitlines()]
    assert [record.reason for record in records] == ["ego_crash"] * 3


def register(monkeypatch, folder: Path, **tables: str) -> None:
    file = folder / "egos.toml"
    file.write_text("".join(f"[{name}]\n{table}" for name, table in tables.items()))
    monkeypatch.setenv("RISK_SAC_EGOS", str(file))


def spec_of(driver: str, *, family: str = "low", episodes: int = 6, method: str = "random") -> RunSpec:
    data = {"family": family, "method": method, "seed": 5, "budget": {"episodes": episodes}, "ego": {"driver": driver}}
    return RunSpec.model_validate_json(json.dumps(data))


def play(spec: RunSpec, folder: Path) -> tuple[RunResults, list[EpisodeRecord]]:
    results = run(spec, folder, lambda done, metrics: None)
    lines = (folder / "episodes.jsonl").read_bytes().splitlines()
    return results, [EpisodeRecord.model_validate_json(line) for line in lines]


def frames(family: str, driver: str | None, episode: int, *, controlled: bool = False, **ego: Any) -> list[Frame]:
    """Of an episode without an attack."""
    spec = RunSpec(family=family, method="random", seed=0, ego=EgoConfig(driver=driver, **ego))
    with closing(RiskSacEnv(Problem.from_spec(spec), spec.learner.reward, controlled=controlled)) as env:
        scene = env.problem.space.from_unit(np.random.default_rng((3, episode)).random(env.problem.space.dimension))
        env.reset(seed=episode, options={"scene": scene})
        ended = False
        while not ended:
            *_, terminated, truncated, _ = env.step(np.zeros(env.action_size, dtype=np.float32))
            ended = terminated or truncated
        return env.trace.frames


def test_sensors_and_actuators_change_an_episode_and_its_seed_repeats_it():
    equipment = {"sensors": "camera", "actuators": "by-wire"}
    exact, first, second = (frames("low", "r157", 1, **ego) for ego in ({}, equipment, equipment))
    assert [frame.state.tobytes() for frame in first] == [frame.state.tobytes() for frame in second]
    assert [frame.state.tobytes() for frame in first] != [frame.state.tobytes() for frame in exact]


@pytest.mark.parametrize("family", ["low", "mixed", "dense"])
@pytest.mark.parametrize("driver", ["r157", "rss", "idm-aeb"])
def test_a_shipped_ego_touches_nobody_when_nobody_attacks(family, driver):
    for episode in range(2):
        try:
            found = frames(family, driver, episode)
        except InfeasibleScene:
            continue
        assert len(found) > 100  # to the horizon
        moved_m = np.hypot(np.diff([f.x_m[0] for f in found]), np.diff([f.y_m[0] for f in found]))
        assert moved_m.max() < 2.0  # and it jumps nowhere, junctions included


def test_sumo_s_drivers_see_where_the_ego_is_and_how_fast():
    """Followers keep their distance also at lanes' ends and junctions."""
    import libsumo

    spec = RunSpec(family="dense", method="random", seed=0, ego=EgoConfig(driver="idm-aeb"))
    with closing(RiskSacEnv(RiskSacEnv.of(spec).problem, spec.learner.reward, controlled=False)) as env:
        env.reset(seed=1)
        lanes = set()
        for _ in range(env.problem.family.horizon_steps):
            env.step(np.zeros(env.action_size, dtype=np.float32))
            frame = env.trace.frames[-1]
            cos, sin = np.cos(frame.heading_rad[0]), np.sin(frame.heading_rad[0])
            front = frame.x_m[0] + frame.length_m[0] / 2 * cos, frame.y_m[0] + frame.length_m[0] / 2 * sin
            assert libsumo.vehicle.getPosition("ego") == pytest.approx(front, abs=1e-6)
            assert libsumo.vehicle.getSpeed("ego") == pytest.approx(frame.speed_mps[0])
            lanes.add(libsumo.vehicle.getLaneID("ego"))
    assert any(lane.startswith(":") for lane in lanes) or len(lanes) == 1


def test_a_process_that_dies_fails_the_run_and_the_same_run_goes_on_when_it_is_back(tmp_path, monkeypatch):
    pytest.importorskip("grpc")
    with served("idm-aeb", tmp_path, deadline_s=60) as table:
        register(monkeypatch, tmp_path, far=table)
        version = pinned(EgoConfig(driver="far")).version
    with pytest.raises(ConfigError, match="5 episodes in a row, the last time with ego_crash"):
        play(spec_of("far"), tmp_path / "run")
    with served("idm-aeb", tmp_path, deadline_s=60) as table:
        register(monkeypatch, tmp_path, far=table)
        assert pinned(EgoConfig(driver="far")).version == version
        results, records = play(spec_of("far"), tmp_path / "run")
    assert results.finished
    assert all(record.outcome is not Outcome.INVALID for record in records)


@pytest.mark.parametrize("fails", ["raise SystemExit(0)", "__import__('os')._exit(0)"])
def test_invalid_episodes_are_counted_by_no_rate(install, tmp_path, fails):
    install(f"if self.steps == 30 and perceived.state[0, 0] % 2 < 1: {fails}")
    results, records = play(spec_of("example", episodes=12), tmp_path)
    assert results.finished
    metrics, invalid = results.metrics, [record for record in records if record.outcome is Outcome.INVALID]
    assert 0 < metrics.invalid == len(invalid) < 12
    assert {record.reason for record in invalid} == {"ego_crash"}
    assert all(record.collision is None and record.steps == 29 for record in invalid)
    assert metrics.ecr == metrics.failures / (12 - metrics.invalid)


@pytest.mark.parametrize(
    ("body", "reason"),
    [
        ("raise ValueError('by me')", "ego_crash"),
        ("return None", "ego_malformed"),
    ],
)
def test_five_in_a_row_fail_the_run(install, tmp_path, body, reason):
    install(body)
    with pytest.raises(ConfigError, match=f"5 episodes in a row, the last time with {reason}"):
        play(spec_of("example"), tmp_path)


def test_a_run_refuses_another_version_of_its_ego(install, tmp_path):
    install(version="1")
    spec = spec_of("example", episodes=2)
    spec = spec.model_copy(update={"ego": pinned(spec.ego)})
    play(spec, tmp_path)
    before = spec.digest
    install(version="1", body="self.steps += 1")  # the same by name
    with pytest.raises(ConfigError, match=r"ego\.version"):
        play(spec, tmp_path)
    unpinned = spec_of("example", episodes=2)
    assert unpinned.model_copy(update={"ego": pinned(unpinned.ego)}).digest != before
    with pytest.raises((ConfigError, CheckpointError)):
        play(unpinned, tmp_path)


def test_an_ego_s_card_is_read_without_running_it(install):
    install(body="pass", summary="Runs nowhere.")
    with (Path(sys.path[0]) / "example_ego.py").open("a") as source:
        source.write("\nraise SystemExit('it ran')\n")
    card = card_of("example")
    assert (card.kind, card.response_time_s, card.summary) == ("python", 0.4, "Runs nowhere.")
    assert card in cards()
    assert pinned(EgoConfig(driver="example")).response_s == 0.4


class Yielding:
    """Garbage in a circle; its collection hands the interpreter to another thread."""

    def __init__(self) -> None:
        self.itself = self

    def __del__(self) -> None:
        time.sleep(0)


def test_cards_are_read_in_many_threads():
    before = gc.get_threshold()
    gc.set_threshold(50)  # so that collections fall into the reading of syntax trees
    try:
        with ThreadPoolExecutor(8) as pool:
            read = list(pool.map(lambda _: (Yielding(), cards())[1], range(60)))
    finally:
        gc.set_threshold(*before)
    assert read == [cards()] * 60


def test_an_ego_without_a_version_is_refused(install):
    install(version="")
    with pytest.raises(ConfigError, match="version: "):
        card_of("example")


def test_an_ego_that_allows_two_instances_is_played_by_two_processes(install, monkeypatch, caplog):
    monkeypatch.setenv("RISK_SAC_ROLLOUTS", "3")
    rounds = spec_of("example").model_copy(update={"budget": Budget(episodes=8, batch=8)})
    install()
    assert processes_of(rounds) == 3
    install(version='1"\n    instances = 2  # "')
    assert processes_of(rounds) == 2
    assert "the ego 'example' allows no more instances" in caplog.text


def test_a_request_names_only_what_is_registered(client):
    body = {"families": ["low"], "methods": ["random"], "budget": {"episodes": 1}, "ego": {"driver": "nobody-s"}}
    refused = client.post("/v1/campaigns", json=body)
    assert refused.status_code == 422
    assert refused.json()["errors"][0]["field"] == "ego.driver"
    items = {item["name"]: item for item in client.get("/v1/egos").json()["items"] if item["kind"] != "sumo"}
    assert {"r157", "rss", "idm-aeb", "broken"} <= items.keys()
    assert not any("address" in item for item in items.values())


def test_a_planner_in_another_process_is_told_the_same_road(tmp_path, monkeypatch):
    pytest.importorskip("grpc")
    here = frames("dense", "fiss-plus", 3)
    with served("fiss-plus", tmp_path, deadline_s=60) as table:
        register(monkeypatch, tmp_path, far=table)
        there = frames("dense", "far", 3)
    np.testing.assert_array_equal([frame.state[:, 0] for frame in there], [frame.state[:, 0] for frame in here])


def test_a_request_names_only_defects_that_exist_and_fit(client):
    body = {"families": ["low"], "methods": ["random"], "budget": {"episodes": 1}}
    for ego in ({"driver": "idm-aeb", "defects": ["blind"]}, {"defects": ["latency"]}):
        refused = client.post("/v1/campaigns", json=body | {"ego": ego})
        assert refused.status_code == 422
        assert refused.json()["errors"][0]["field"] == "ego.defects"
    listed = {item["name"]: item["kind"] for item in client.get("/v1/egos").json()["defects"]}
    assert listed["latency"] == "perception"


@pytest.mark.parametrize("ego", [{"driver": "idm-aeb", "defects": ("latency",)}, {"defects": ("sumo-distracted",)}])
def test_records_say_when_a_defect_was_reached_and_runs_repeat(ego, tmp_path):
    spec = spec_of("idm-aeb", episodes=4).model_copy(update={"ego": EgoConfig.model_validate(ego)})
    (first, records), (second, _) = play(spec, tmp_path / "first"), play(spec, tmp_path / "second")
    assert first.digest == second.digest
    reached = [record.defect_reached_s for record in records if record.steps]
    assert all((reached_s is not None) is ("driver" in ego) for reached_s in reached)


@pytest.mark.parametrize("family", ["low", "dense"])
def test_a_planner_drives_a_run(tmp_path, family):
    results, records = play(spec_of("fiss-plus", family=family, episodes=2), tmp_path / "run")
    assert results.metrics.environment_steps > 100
    assert all(record.outcome is not Outcome.INVALID for record in records)


@pytest.mark.skipif(not CPP_COMPILES, reason="needs C++ and gRPC")
@pytest.mark.torture
def test_the_example_in_c_plus_plus_compiles_and_drives(tmp_path, monkeypatch):
    pytest.importorskip("grpc")
    with served_by_cpp(tmp_path, deadline_s=60) as table:
        register(monkeypatch, tmp_path, cpp=table)
        results, records = play(spec_of("cpp", episodes=4), tmp_path / "run")
    assert results.metrics.environment_steps > 200
    assert all(record.outcome is not Outcome.INVALID for record in records)
