"""Plays old failures against another ego, and tells which are fixed.

Each is first played with its own ego, so that nothing counts as fixed that would not fail here anyway. Then the other
ego meets the recorded actions, and after them the policy that found the failure, if there is one: a contact that is
only delayed is not avoided. Scripts that found it are followed as well, since they react to where the ego is.

Every requirement that the failure violated has to be kept. A contact still fails with the same striker in the same type
of conflict; a violation without contact, whatever is near.
"""

from collections.abc import Iterator, Sequence
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from risk_sac.config import EgoConfig, RunSpec, method_of
from risk_sac.env.env import RiskSacEnv
from risk_sac.errors import ConfigError, InfeasibleScene, RiskSacError
from risk_sac.failures.bundle import Bundle, check_world, code_digest, make_bundle, versions
from risk_sac.failures.play import Played, Policy, play
from risk_sac.failures.recording import actions_of, trajectory_digest
from risk_sac.failures.studied import Case, Verdict
from risk_sac.failures.study import policy_of, recorded_bundle
from risk_sac.failures.variants import alike
from risk_sac.records import Collision, Violation
from risk_sac.run_folder.results import first_of_variants, read_results
from risk_sac.search.agents.controls import Held, ScriptFollower
from risk_sac.search.frozen_policy import FrozenPolicy
from risk_sac.search.prior.attacker import going_on
from risk_sac.search.prior.policy import starts_pretrained
from risk_sac.world.types import Floats, Scene

WORSE = (Verdict.FIXED, Verdict.NOT_COMPARABLE, Verdict.NEW_KIND, Verdict.STILL_FAILING)
BLIND = "seen_before"  # the rule that an ego breaks by seeing nothing: no way to be fixed


class _Ending(NamedTuple):
    """Outcome of one attack on the other ego."""

    verdict: Verdict
    reason: str
    found: str = ""  # kind of what happened instead
    played: Played | None = None  # how it went, where a requirement that counts was violated


class Regressed(NamedTuple):
    """Outcome of an old failure."""

    case: Case
    bundle: Bundle  # of what the other ego violates now; where that cannot be compared or is nothing, the old failure


def regress(bundle: Bundle, ego: EgoConfig) -> Regressed:
    """Plays one failure against another ego."""
    manifest = bundle.manifest
    named = manifest.episode.worst_violation
    ending = _judge(bundle, ego)
    case = Case(
        id=manifest.id,
        digest=manifest.digest,
        name=named.kind if named else "no violation",
        grade=named.graded if named else None,
        verdict=ending.verdict,
        reason=ending.reason,
        found=ending.found,
    )
    return Regressed(case, bundle if ending.played is None else _as_played(bundle, ego, ending.played))


def _as_played(bundle: Bundle, ego: EgoConfig, played: Played) -> Bundle:
    spec = bundle.manifest.spec.model_copy(update={"ego": ego})
    episode = played.record(bundle.manifest.episode)
    return make_bundle(spec, episode, played.series, played.signal_heads, bundle.policy)


def regress_run(folder: Path, ego: EgoConfig) -> Iterator[Regressed]:
    """Plays each variant's first failures of a run against another ego.

    Raises:
      ConfigError: the folder holds no run, or none whose policy can act on.
      DamagedError, OSError: a series cannot be read.
    """
    results = read_results(folder)
    policy = policy_of(folder, results)
    if policy is None and method_of(results.spec.method).learns:
        got = f"{folder} has not finished, or has no checkpoint, so that its policy cannot act on"
        raise ConfigError("--failures", got, remedy="make bundles")
    for episode in first_of_variants(results):
        yield regress(recorded_bundle(folder, results, episode, policy), ego)


def _judge(bundle: Bundle, ego: EgoConfig) -> _Ending:
    manifest = bundle.manifest
    wanted = manifest.episode.valid_violations
    if not wanted:
        return _Ending(Verdict.NOT_COMPARABLE, "it is no valid failure")
    try:
        check_world(manifest)
        own = _play(manifest.spec, bundle, None)
        if trajectory_digest(own.series) != manifest.digest:
            if (manifest.code, manifest.versions) == (code_digest(), versions()):
                return _Ending(Verdict.FLAKY, "with its own ego it goes another way than recorded")
            wanted = tuple(each for each in wanted if alike(own.found, each))
            if not wanted:
                why = "with its own ego it does not happen under this code and these packages"
                return _Ending(Verdict.NOT_COMPARABLE, why)
        other = manifest.spec.model_copy(update={"ego": ego})
        actions = "recorded actions"
        if method_of(manifest.spec.method).learns and bundle.policy is None:
            actions += ", without its policy,"
        attacks = {actions: partial(_play, other, bundle, bundle.policy)}
        if manifest.episode.script is not None:
            attacks["its scripts"] = partial(_follow, other, bundle)
        endings = {}
        for name, attack in attacks.items():
            first, second = attack(), attack()
            if trajectory_digest(first.series) != trajectory_digest(second.series):
                return _Ending(Verdict.FLAKY, f"with {name} this ego went another way the second time")
            endings[name] = compared(first.found, wanted)._replace(played=first if first.found else None)
    except InfeasibleScene as error:
        return _Ending(Verdict.NOT_COMPARABLE, f"its scene is refused with this ego: {error.reason}")
    except RiskSacError as error:
        return _Ending(Verdict.NOT_COMPARABLE, str(error))
    worst = max(endings.values(), key=lambda ending: WORSE.index(ending.verdict))
    reasons = [f"with {name} {each.reason}" for name, each in endings.items() if each.verdict is worst.verdict]
    return worst._replace(reason="; ".join(reasons))


def compared(violations: Sequence[Collision | Violation], wanted: Sequence[Collision | Violation]) -> _Ending:
    """Compares the violations of an old failure with another ego's."""
    if still := [each for each in violations if any(alike([each], old) for old in wanted)]:
        return _Ending(Verdict.STILL_FAILING, _events(still), still[0].kind)
    if valid := [each for each in violations if each.valid]:
        return _Ending(Verdict.NEW_KIND, f"{_events(valid)}: {valid[0].kind}", valid[0].kind)
    if not violations:
        kept = (f"{old.requirement} is kept" if isinstance(old, Violation) else "nothing is touched" for old in wanted)
        return _Ending(Verdict.FIXED, " and ".join(kept))
    events, broken = _events(violations), {rule for each in violations for rule in each.broken}
    said = f"{events}, which is not its failure: {', '.join(sorted(broken))}"
    if any(each.artefact for each in violations):  # and it may have ended the episode before the failure
        return _Ending(Verdict.NOT_COMPARABLE, said)
    if BLIND in broken:
        return _Ending(Verdict.NEW_KIND, f"{events}, which it never saw", violations[0].kind)
    return _Ending(Verdict.FIXED, said)


def _events(violations: Sequence[Collision | Violation]) -> str:
    return " and ".join(each.event for each in violations)


def _play(spec: RunSpec, bundle: Bundle, policy: FrozenPolicy | None) -> Played:
    """Plays the recorded actions, and the rest of the horizon."""
    with closing(RiskSacEnv.of(spec)) as env:
        actions = actions_of(bundle.series)
        if policy is None:
            rest = env.problem.family.horizon_steps - len(actions)
            return _played(env, bundle, np.pad(actions, ((0, rest), (0, 0))), None)
        held, problem = Held(spec.learner.agent.decision_steps), env.problem
        drive: Policy = going_on(policy, problem, actions) if starts_pretrained(spec, problem) else policy
        return _played(env, bundle, actions, lambda observation: held.act(partial(drive, observation)))


def _follow(spec: RunSpec, bundle: Bundle) -> Played:
    with closing(RiskSacEnv.of(spec)) as env:
        follower = ScriptFollower(env.problem.family)
        follower.begin(np.array(bundle.manifest.episode.script))
        return _played(env, bundle, np.empty((0, env.action_size)), follower.act)


def _played(env: RiskSacEnv, bundle: Bundle, actions: Floats, policy: Policy | None) -> Played:
    episode = bundle.manifest.episode
    return play(env, Scene(env.problem.family.name, episode.scene), episode.seed, actions, policy)
