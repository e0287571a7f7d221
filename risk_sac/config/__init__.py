"""Every setting of the system, as frozen pydantic models with unit and meaning by each field."""

from risk_sac.config.base import Interval, Settings
from risk_sac.config.campaign import FAMILY_NAME, SHIPPED, Budget, CampaignSpec, FamilyName, Iid, Requirement, RunSpec
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

__all__ = [
    "FAMILY_NAME",
    "IID_METHODS",
    "METHODS",
    "SHIPPED",
    "AgentConfig",
    "Behaviour",
    "Budget",
    "CampaignSpec",
    "CarFollowing",
    "CrossingType",
    "DdpgConfig",
    "DynamicElements",
    "EgoConfig",
    "Environment",
    "FamilyName",
    "Iid",
    "IidName",
    "Interval",
    "LagrangianConfig",
    "LearnerConfig",
    "Method",
    "MethodName",
    "Odd",
    "Precipitation",
    "ReplayConfig",
    "Requirement",
    "RewardConfig",
    "RunMethod",
    "RunSpec",
    "SacConfig",
    "SceneOptimizerConfig",
    "Scenery",
    "SensorConfig",
    "Settings",
    "SignalType",
    "WarmStartConfig",
    "method_of",
]
