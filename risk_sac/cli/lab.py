"""`risk-sac benchmark`, `power`, `pretrain`: measures methods and makes shipped priors."""

import argparse
import json
import math
import multiprocessing
import time
from collections.abc import Sequence
from concurrent.futures import Executor, ProcessPoolExecutor, as_completed
from pathlib import Path

from rich.box import SIMPLE_HEAD
from rich.progress import Progress
from rich.table import Table

from risk_sac.cli.console import OK, folded_table, number, say
from risk_sac.cli.flags import kept_name
from risk_sac.cli.parser import Commands, add_command
from risk_sac.config import MethodName
from risk_sac.config.base import read_text
from risk_sac.config.methods import named_methods
from risk_sac.egos.defects.catalogue import DEFECTS
from risk_sac.errors import ConfigError
from risk_sac.host.machine import cores
from risk_sac.host.terminal import console
from risk_sac.records import Counts
from risk_sac.report.statistics import (
    NOT_MEASURED,
    BenchmarkRun,
    PlayedCounts,
    measured,
    method_power,
    power_of,
    runs_of,
)
from risk_sac.scenario.reading import PAPER_FAMILIES, shipped_names

METHODS: Sequence[MethodName] = ("random", "archive", "risk-sac-diverse")
SEEDS, STEPS = 10, 20_000
WRITTEN_EVERY_S = 60.0
EPISODES = "episodes"
SHOWN = ("method", "falsification rate (95 %)", "median steps", "restricted mean steps (95 %)", "p (log-rank)")


def add_benchmark(commands: Commands) -> None:
    """Adds the commands."""
    parser = add_command(
        commands,
        "benchmark",
        _benchmark,
        "measure how soon methods detect egos with known faults",
        more="The same command again continues an interrupted benchmark.",
        example="benchmark --methods archive --defects blind-right --seeds 2 --out runs/benchmark",
    )
    search, known = parser.group("search"), named_methods()
    names = f"of {', '.join(known)} (default: {' '.join(METHODS)})"
    search.add_argument("--methods", nargs="+", choices=known, default=METHODS, metavar="NAME", help=names)
    which = search.add_mutually_exclusive_group()
    which.add_argument("--defects", nargs="+", metavar="NAME", help="(default: the whole catalogue)")
    which.add_argument("--test-set", action="store_true", help="the defects that nothing was tuned on")
    search.add_argument("--seeds", type=number(int, 1, 1000), default=SEEDS, metavar="N", help="(default: %(default)s)")
    search.add_argument("--first-seed", type=number(int, 0), default=0, metavar="S", help="(default: %(default)s)")
    steps = "environment steps of a run without a detection (default: %(default)s)"
    parser.group("budget").add_argument(
        "--steps", type=number(int, 1, 10_000_000), default=STEPS, metavar="N", help=steps
    )
    batch = "episodes of a round; another one needs another DIR (default: %(default)s)"
    search.add_argument("--batch", type=number(int, 1, 1024), default=1, metavar="Q", help=batch)
    jobs = "runs at a time (default: one per core)"
    parser.group("execution").add_argument("--jobs", type=number(int, 1, 1000), metavar="N", help=jobs)
    shown = "write the tables of the runs that have ended so far; play nothing"
    parser.group("execution").add_argument("--tables-only", action="store_true", help=shown)
    out = "a folder for each run, and tables and figures of those that have ended"
    parser.group("output").add_argument("--out", type=Path, required=True, metavar="DIR", help=out)
    worth = add_command(
        commands,
        "power",
        _power,
        "estimate how many known faults a method finds with a budget",
        more="The estimate comes from a benchmark that was measured.",
        example="power --scenario low --method archive --steps 20000",
    )
    budget = worth.group("budget")
    folders = "folder of `risk-sac evaluate`, or folders of runs, whose budget it is; instead of the flags"
    worth.add_argument("runs", type=Path, nargs="*", metavar="RUNS", help=folders)
    budget.add_argument(
        "--scenario", dest="families", nargs="+", choices=PAPER_FAMILIES, metavar="FAMILY", help="(default: all)"
    )
    budget.add_argument("--method", choices=known, metavar="NAME", help="(default: archive)")
    budget.add_argument("--steps", type=number(int, 1), metavar="N", help=f"(default: {STEPS})")
    measured = "detections.csv of a benchmark (default: the one that is shipped)"
    budget.add_argument("--measured", type=Path, metavar="FILE", help=measured)


def _benchmark(options: argparse.Namespace) -> int:
    # Here, because loading the simulator takes seconds.
    from risk_sac.lab.benchmark.runs import Benchmark, ended, play
    from risk_sac.lab.benchmark.statistics import balanced
    from risk_sac.lab.benchmark.table import METHODS as COLUMNS
    from risk_sac.lab.benchmark.table import methods_rows, write

    test_set = [name for name, defect in DEFECTS.items() if defect.test_set]
    benchmark = Benchmark(
        methods=tuple(options.methods),
        defects=tuple(test_set if options.test_set else options.defects or DEFECTS),
        seeds=tuple(range(options.first_seed, options.first_seed + options.seeds)),
        budget_steps=options.steps,
        batch=options.batch,
    )
    detections, written_s = ended(benchmark, options.out), -math.inf
    if not options.tables_only:
        with Progress(console=console) as bar:
            task = bar.add_task("runs", total=len(list(benchmark.specs())), completed=len(detections))
            for detection in play(benchmark, options.out, options.jobs or cores()):
                detections.append(detection)
                bar.advance(task)
                if time.monotonic() - written_s > WRITTEN_EVERY_S:
                    write(detections, options.out, options.typed)
                    written_s = time.monotonic()
    write(detections, options.out, options.typed)
    places = [COLUMNS.index(name) for name in SHOWN]
    say(folded_table(SHOWN, ([row[place] for place in places] for row in methods_rows(balanced(detections)))))
    say(f"All tables and figures: {options.out / 'benchmark.md'}")
    return OK


def _power(options: argparse.Namespace) -> int:
    runs = measured() if options.measured is None else runs_of(read_text(options.measured, "measured"))
    if options.runs:
        return _power_of_folders(options, runs)
    if not runs:
        say(NOT_MEASURED)
        return OK
    method, families = options.method or "archive", options.families or PAPER_FAMILIES
    power = method_power(method, dict.fromkeys(families, (options.steps or STEPS, 1)), runs)
    if not power.defects:
        known = ", ".join(sorted({run.method for run in runs if run.family in families}))
        raise ConfigError("--method", f"{method!r}, of which nothing was measured in {', '.join(families)}", known)
    table = Table("defect", "family", "detected", "runs", box=SIMPLE_HEAD)
    for each in power.defects:
        table.add_row(each.defect, each.family, str(each.detected), str(each.runs))
    console.print(table)
    say(" ".join(power.sentences))
    return OK


def _power_of_folders(options: argparse.Namespace, runs: Sequence[BenchmarkRun]) -> int:
    from risk_sac.report.files import campaign_in  # here, because loading numpy takes a while

    if given := [name for name in ("families", "method", "steps") if getattr(options, name) is not None]:
        raise ConfigError(f"--{given[0]}", "RUNS are given beside it", remedy="leave one of the two out")
    campaign, results = campaign_in(options.runs)
    searches = [(each, each.metrics or Counts()) for each in results.values() if not each.spec.iid]
    played = [
        PlayedCounts(each.spec.family, each.spec.method, did.episodes, did.environment_steps, each.finished)
        for each, did in searches
    ]
    found = power_of(campaign, played, runs)
    for line in (*found.lines, found.note):
        say(line)
    return OK


def add_pretrain(commands: Commands) -> None:
    """Adds the command."""
    parser = add_command(
        commands,
        "pretrain",
        _pretrain,
        "make a prior: play scripts and train a policy before many egos",
        more="The same command again goes on with an interrupted one. It writes DIR/scripts.npz and DIR/policy.npz, one"
        " script model and one policy for all scenarios, DIR/policy.json with the curve of its training, and for each"
        " family of the paper DIR/<family>.npz with its library. The policy is shown scripts of DIR/episodes that"
        " failed an ego. Every third shipped document by name only tests.",
        example="pretrain --scenario low left_turn_car --streams 2 --chunks 4 --policy-episodes 0 --out results/prior",
    )
    titles = ("scene", "script model", "policy", "execution", "output")
    scene, scripts, policy, execution, output = map(parser.group, titles)
    scene.add_argument(
        "--scenario",
        dest="families",
        nargs="+",
        default=[],
        metavar="NAME_OR_FILE",
        help="(default: all that ship; a policy is not trained on those held out)",
    )
    streams = "independent sequences of script episodes for each family; 0: no script model (default: %(default)s)"
    scripts.add_argument("--streams", type=number(int, 0, 100), default=4, metavar="N", help=streams)
    chunks = "chunks of 250 episodes in each stream (default: %(default)s)"
    scripts.add_argument("--chunks", type=number(int, 1, 10_000), default=50, metavar="N", help=chunks)
    episodes = "episodes of the policy; 0: none (default: %(default)s)"
    policy.add_argument("--policy-episodes", type=number(int, 0, 1_000_000), default=10_000, metavar="N", help=episodes)
    execution.add_argument("--seed", type=number(int, 0), default=0, metavar="S", help="(default: %(default)s)")
    device = "where the policy is trained; episodes are played on the CPU (default: %(default)s)"
    execution.add_argument("--device", choices=("cpu", "cuda"), default="cpu", help=device)
    jobs = "processes that play at a time (default: one per core)"
    execution.add_argument("--jobs", type=number(int, 1, 1000), metavar="N", help=jobs)
    output.add_argument("--out", type=Path, required=True, metavar="DIR", help="for episodes and priors")


def _pretrain(options: argparse.Namespace) -> int:
    options.families = [kept_name(name) for name in options.families]
    options.out.mkdir(parents=True, exist_ok=True)
    with ProcessPoolExecutor(options.jobs or cores(), multiprocessing.get_context("spawn")) as pool:
        if options.streams:
            _fit_scripts(options, pool)
        if options.policy_episodes:
            _train_policy(options, pool)
    return OK


def _fit_scripts(options: argparse.Namespace, pool: Executor) -> None:
    # Here, because loading torch and the simulator takes seconds.
    from risk_sac.lab.pretraining.episodes import play_stream
    from risk_sac.lab.pretraining.fit import Dataset, fit, library_of
    from risk_sac.search.prior.shipped import MODEL, write_library, write_model

    episodes: Path = options.out / EPISODES
    episodes.mkdir(exist_ok=True)
    families = options.families or shipped_names()
    wanted = [(family, options.seed, k) for k in range(options.streams) for family in families]
    with Progress(console=console) as bar:
        task = bar.add_task("streams", total=len(wanted))
        for ended in as_completed([pool.submit(play_stream, *each, episodes, options.chunks) for each in wanted]):
            ended.result()
            bar.advance(task)
    data = Dataset.read(episodes, families)
    model, card = fit(data, options.seed)
    write_model(options.out / MODEL, model, card)
    for family in PAPER_FAMILIES:
        if family in families:
            write_library(options.out / f"{family}.npz", library_of(data.of([family]), model, family))
    say(f"{card['episodes']} episodes; area under the ROC curve:")
    for where, scores in card["area_under_curve"].items():
        say(f"  {where}: {', '.join(f'{name} {value}' for name, value in scores.items())}")


def _train_policy(options: argparse.Namespace, pool: Executor) -> None:
    from risk_sac.lab.pretraining.policy import PolicyTraining
    from risk_sac.search.prior.policy import POLICY, write_policy

    seed, episodes = options.seed, options.policy_episodes
    training = PolicyTraining(options.out / EPISODES, seed, episodes, options.device, families=options.families)
    file: Path = options.out / POLICY

    def write() -> None:
        write_policy(file, training.pretrained())
        file.with_suffix(".json").write_text(json.dumps(training.curve, indent=1) + "\n")

    for point in training.run(pool, options.out):
        say(
            f"after {point['episodes']} episodes of the policy {point['failing']:.3f} of the last fail,"
            f" {point['held_out']['failing']:.2f} before egos held out"
        )
        write()
    write()  # with what it has learnt since the last point
