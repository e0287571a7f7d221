"""`risk-sac pretrain`: makes the prior of each family from episodes before the training egos."""

import argparse
import json
import multiprocessing
from concurrent.futures import Executor, ProcessPoolExecutor, as_completed
from pathlib import Path

from rich.progress import Progress

from risk_sac.cli.console import OK, number, say
from risk_sac.cli.parser import Commands, add_command
from risk_sac.config import SHIPPED, FamilyName
from risk_sac.host.machine import cores
from risk_sac.host.terminal import console


def add(commands: Commands) -> None:
    """Adds the command."""
    parser = add_command(
        commands,
        "pretrain",
        _pretrain,
        "make a prior: play scripts and train a policy before many egos",
        more="The same command again goes on with an interrupted one. For each family it writes DIR/<family>.npz with"
        " script model and library, and DIR/<family>-policy.npz with the curve of its training beside it.",
        example="pretrain --families low --streams 2 --chunks 4 --policy-episodes 0 --out results/prior",
    )
    titles = ("scene", "script model", "policy", "execution", "output")
    scene, scripts, policy, execution, output = map(parser.group, titles)
    scene.add_argument(
        "--families", nargs="+", choices=SHIPPED, default=list(SHIPPED), metavar="NAME", help="(default: all)"
    )
    streams = "independent sequences of script episodes for each family; 0: no script model (default: %(default)s)"
    scripts.add_argument("--streams", type=number(int, 0, 100), default=4, metavar="N", help=streams)
    chunks = "chunks of 250 episodes in each stream (default: %(default)s)"
    scripts.add_argument("--chunks", type=number(int, 1, 10_000), default=50, metavar="N", help=chunks)
    episodes = "episodes of the policy for each family; 0: no policy (default: %(default)s)"
    policy.add_argument("--policy-episodes", type=number(int, 0, 1_000_000), default=10_000, metavar="N", help=episodes)
    kinds = "ask the policy for one kind of failure in each episode"
    policy.add_argument("--kinds", action="store_true", help=kinds)
    execution.add_argument("--seed", type=number(int, 0), default=0, metavar="S", help="(default: %(default)s)")
    device = "where policies are trained; episodes are played on the CPU (default: %(default)s)"
    execution.add_argument("--device", choices=("cpu", "cuda"), default="cpu", help=device)
    jobs = "processes that play at a time (default: one per core)"
    execution.add_argument("--jobs", type=number(int, 1, 1000), metavar="N", help=jobs)
    output.add_argument("--out", type=Path, required=True, metavar="DIR", help="for episodes and priors")


def _pretrain(options: argparse.Namespace) -> int:
    options.out.mkdir(parents=True, exist_ok=True)
    with ProcessPoolExecutor(options.jobs or cores(), multiprocessing.get_context("spawn")) as pool:
        if options.streams:
            _fit_scripts(options, pool)
        if options.policy_episodes:
            for family in options.families:
                _train_policy(options, pool, family)
    return OK


def _fit_scripts(options: argparse.Namespace, pool: Executor) -> None:
    # Here, because loading torch and the simulator takes seconds.
    from risk_sac.lab.pretraining.episodes import play_stream
    from risk_sac.lab.pretraining.fit import Dataset, fitted_prior
    from risk_sac.search.prior.shipped import write_prior

    episodes: Path = options.out / "episodes"
    episodes.mkdir(exist_ok=True)
    wanted = [(family, options.seed, k) for k in range(options.streams) for family in options.families]
    with Progress(console=console) as bar:
        task = bar.add_task("streams", total=len(wanted))
        for ended in as_completed([pool.submit(play_stream, *each, episodes, options.chunks) for each in wanted]):
            ended.result()
            bar.advance(task)
    for family in options.families:
        prior = fitted_prior(family, Dataset.read(episodes, family), options.seed)
        write_prior(options.out / f"{family}.npz", prior)
        say(f"{family}: {prior.card['episodes']} episodes, AUC of failing {prior.card['auc_fails']:.2f}")


def _train_policy(options: argparse.Namespace, pool: Executor, family: FamilyName) -> None:
    from risk_sac.lab.pretraining.policy import PolicyTraining
    from risk_sac.search.prior.policy import write_policy

    training = PolicyTraining(family, options.seed, options.policy_episodes, options.device, kinds=options.kinds)

    def write() -> None:
        write_policy(options.out / f"{family}-policy.npz", training.pretrained())
        (options.out / f"{family}-policy.json").write_text(json.dumps(training.curve, indent=1) + "\n")

    for point in training.run(pool, options.out):
        say(
            f"{family}: after {point['episodes']} episodes of the policy {point['failing']:.3f} of the last fail,"
            f" {point['held_out']['failing']:.2f} before egos held out"
        )
        write()
    write()  # with what it has learnt since the last point
