"""Settings of the method: agent, replay, constraint, reward, scene optimiser.

Defaults hold for all families and methods alike; risk_sac/deviations.md says how they were chosen.
"""

from typing import Annotated, Literal

from pydantic import Field

from risk_sac.config.base import Fraction, Settings, Weight

CriticLoss = Literal["squared", "huber"]
Width = Annotated[int, Field(ge=1, le=4096)]
LearningRate = Annotated[float, Field(ge=1e-7, le=0.01)]
MOST_TEMPERATURE = 100.0  # α


class AgentConfig(Settings):
    """Settings of all agents: networks, optimisers and the pace of learning."""

    hidden_sizes: Annotated[tuple[Width, ...], Field(min_length=1, max_length=4)] = (64, 64)
    """Units of each hidden layer, actor and critics alike."""
    batch_size: Annotated[int, Field(ge=1, le=4096)] = 256
    discount: Annotated[float, Field(ge=0.01, le=0.9999)] = 0.99
    """γ; 0.99 at 0.1 s looks about 10 s ahead."""
    actor_learning_rate: LearningRate = 1e-3
    critic_learning_rate: LearningRate = 1e-3
    target_rate: Annotated[float, Field(ge=1e-5, le=1)] = 0.01
    """τ of the target networks' moving average."""
    warmup_steps: Annotated[int, Field(ge=0, le=10_000_000)] = 1000
    """Environment steps before the first update, the warm start's included; the policy's own are uniformly random."""
    decision_steps: Annotated[int, Field(ge=1, le=50)] = 5
    """Environment steps for which the policy holds an action; they make one transition of the memory."""
    updates_per_step: Annotated[float, Field(ge=0, le=20)] = 0.2
    """Updates in an environment step; 0.2 is one per decision. An update costs about as much as five steps."""
    critic_loss: CriticLoss = "squared"
    """`huber` is linear in TD errors above 1."""
    weighted_actor: bool = True
    """Importance weights scale the policy's loss, too; false: the critics' alone."""
    device: Literal["auto", "cpu", "cuda"] = "auto"
    """`auto` is the CPU; `cuda` has to be asked for. Results are reproducible on equal devices only."""


class SacConfig(Settings):
    """Soft Actor-Critic (Haarnoja et al. 2018), Eq. 4."""

    temperature_learning_rate: LearningRate = 1e-3
    initial_temperature: Annotated[float, Field(ge=1e-6, le=MOST_TEMPERATURE)] = 0.02
    """α at the start."""
    target_entropy_per_action: Annotated[float, Field(ge=-10, le=0.5)] = -1.0
    """Target entropy divided by the action dimension, nats; uniform actions have log 2."""


class DdpgConfig(Settings):
    """Deep deterministic policy gradient (Lillicrap et al. 2016)."""

    exploration_deviation: Annotated[float, Field(ge=0, le=10)] = 0.2
    """Standard deviation of the Gaussian noise added to actions in [-1, 1]."""


class ReplayConfig(Settings):
    """Replay memory and its risk-guided priorities, Eq. 9-10."""

    capacity: Annotated[int, Field(ge=1000, le=2_000_000)] = 100_000
    td_weight: Weight = 1.0
    """w1, on the normalised TD error."""
    return_weight: Weight = 0.5
    """w2, on the normalised accumulated reward of the episode."""
    robustness_weight: Weight = 0.5
    """w3, on the normalised negative robustness."""
    priority_floor: Annotated[float, Field(ge=1e-6, le=1000)] = 0.05
    """ε > 0: smallest priority, so nothing is forgotten."""
    correction: Fraction = 0.6
    """η, exponent of the importance weights."""


class LagrangianConfig(Settings):
    """The dual variable λ, Eq. 1-2 and Alg. 1, l. 16."""

    initial: Weight = 0.0
    learning_rate: Annotated[float, Field(ge=1e-9, le=1)] = 5e-4
    """η_λ."""
    cost_limit: Fraction = 0.1
    """d, on the policy's mean realism cost per step, which is in [0, 1]. Undisturbed traffic costs about 0; failures
    that people accept cost 0.06 on average, and those that they reject 0.19. This limit parts them best."""
    maximum: Annotated[float, Field(ge=1e-6, le=1000)] = 10.0
    """Cap on λ, far above where it settles; it only keeps λ finite where no policy can keep the limit."""


class RewardConfig(Settings):
    """R_risk (terms of Eq. 1) and the shaping potential (Eq. 6-8)."""

    valid_collision: Weight = 20.0
    """Bonus for a valid collision that a reference driver would have prevented."""
    violation: Weight = 10.0
    """Bonus for each scale by which a requirement that counts is violated without contact, up to one."""
    unpreventable: Fraction = 0.5
    """Share of `valid_collision` where only full braking at once would have prevented it."""
    unavoidable: Fraction = 0.25
    """Share of `valid_collision` where that would not have, either."""
    minor: Fraction = 0.5
    """Share of either where it is minor."""
    degenerate_collision: Weight = 4.0
    """Penalty for contact that a validity rule refuses."""
    ttc_weight: Weight = 0.2
    """Weight of exp(-TTC / ttc_scale_s)."""
    ttc_scale_s: Annotated[float, Field(ge=0.01, le=1000)] = 1.0
    rss_weight: Weight = 0.1
    """Reward per step in which both RSS margins are violated."""
    softmin_sharpness: Annotated[float, Field(ge=0.1, le=1000)] = 20.0
    """β of Eq. 7; robustness is in units of each requirement's scale."""
    zero_terminal_potential: bool = True
    """φ = 0 at terminal states, which policy invariance needs; False is Eq. 8 to the letter."""


class WarmStartConfig(Settings):
    """Warm start of a learner's memory by episodes of an archive search.

    They come before its policy acts; they are the same for all learners.
    """

    episodes: Annotated[int, Field(ge=0, le=10_000)] = 150
    """At most; 0: the policy acts from the first episode on, uniformly at random for `warmup_steps`."""
    failures: Annotated[int, Field(ge=1, le=10_000)] = 15
    """Valid failures that are enough."""


class SceneOptimizerConfig(Settings):
    """Bayesian optimisation of the scene, Eq. 11."""

    initial_scenes: Annotated[int, Field(ge=2, le=1000)] = 16
    """Sobol scenes before the first model."""
    window: Annotated[int, Field(ge=8, le=1000)] = 150
    """Newest observations the model is fitted to: the policy changes, so old scores go stale. Asking and
    telling take at most 25 ms at 150, twice as long at 300."""
    refit_every: Annotated[int, Field(ge=1, le=1000)] = 10
    """Fewest observations between two fits of the kernel's hyper-parameters; a fifth of those kept if that is more."""
    candidates: Annotated[int, Field(ge=16, le=8192)] = 128
    """Sobol points at which the acquisition is scored before gradient ascent from the best."""
    exploration: Fraction = 0.1
    """Share of scenes drawn at random, so that no region is given up."""
    running_maximum_rate: Annotated[float, Field(ge=1e-3, le=1)] = 0.1
    """Share of the way that M̄_e moves towards the largest mean return so far, in every episode."""


class LearnerConfig(Settings):
    """Everything a method may tune, the same for all families."""

    agent: AgentConfig = AgentConfig()
    sac: SacConfig = SacConfig()
    ddpg: DdpgConfig = DdpgConfig()
    replay: ReplayConfig = ReplayConfig()
    lagrangian: LagrangianConfig = LagrangianConfig()
    reward: RewardConfig = RewardConfig()
    warm_start: WarmStartConfig = WarmStartConfig()
    scenes: SceneOptimizerConfig = SceneOptimizerConfig()
    checkpoint_every: Annotated[int, Field(ge=1, le=100_000)] = 20
    """Episodes between two checkpoints."""
