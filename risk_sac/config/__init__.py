"""Every setting of the system, as frozen pydantic models with documented fields."""

from risk_sac.config.base import Interval, Settings, field_errors
from risk_sac.config.campaign import Budget, CampaignSpec, FamilyName, Iid, JudgeConfig, RateStart, Requirement, RunSpec
from risk_sac.config.ego import CarFollowing, EgoConfig, SensorConfig
from risk_sac.config.learner import (
    AgentConfig,
    DdpgConfig,
    LagrangianConfig,
    LearnerConfig,
    ReplayConfig,
    RewardConfig,
    SacConfig,
    SceneOptimizerConfig,
    WarmStartConfig,
)
from risk_sac.config.methods import IID_METHODS, METHODS, IidName, Method, MethodName, RunMethod, method_of
from risk_sac.config.odd import (
    Behaviour,
    CrossingType,
    DynamicElements,
    Environment,
    Odd,
    Precipitation,
    Scenery,
    SignalType,
)
from risk_sac.config.scenario import Like, Scenario
from risk_sac.config.story import DeviationBounds
