"""The scenario families that are shipped."""

from risk_sac.scenario.car_following import LOW
from risk_sac.scenario.family import Family
from risk_sac.scenario.hidden_pedestrian import MIXED
from risk_sac.scenario.junction import DENSE

FAMILIES: dict[str, Family] = {family.name: family for family in (LOW, MIXED, DENSE)}
