"""Places an episode's vehicles and signal in SUMO."""

from collections.abc import Mapping

import libsumo

from risk_sac.config import EgoConfig
from risk_sac.scenario.layout import Layout, VehicleStart
from risk_sac.scenario.limits import GRAVITY_MPS2, emergency_decel_mps2

EGO_DECEL_MPS2 = 4.5  # SUMO's default for passenger cars
LANE_CHANGE = "laneChangeModel."
# So that the commanded lateral speed is the one driven; its limits are those of `risk_sac.sim.control`.
STEERED = {"lcAccelLat": "100", "lcMaxSpeedLatStanding": "5", "lcMaxSpeedLatFactor": "1"}


def place(layout: Layout, ego: EgoConfig, settings: Mapping[str, float]) -> None:
    """Places all vehicles of the layout; SUMO inserts them in its next step.

    Args:
      layout: of the episode.
      ego: its driver.
      settings: further ones of SUMO's driver of the ego: `tau`, or keys of SUMO's `vehicle.setParameter` for its
        lane-change model, and of `vehicletype.setParameter` for the rest.
    """
    ego_type = f"ego_{ego.car_following}"
    libsumo.vehicletype.setActionStepLength(ego_type, ego.reaction_time_s)
    libsumo.vehicletype.setEmergencyDecel(ego_type, emergency_decel_mps2(layout.friction))
    libsumo.vehicletype.setDecel(ego_type, min(EGO_DECEL_MPS2, layout.friction * GRAVITY_MPS2))
    for name, value in settings.items():
        if name == "tau":
            libsumo.vehicletype.setTau(ego_type, value)
        elif not name.startswith(LANE_CHANGE):
            libsumo.vehicletype.setParameter(ego_type, name, f"{value:g}")
    _insert(layout.ego, ego_type)
    for name, value in settings.items():
        if name.startswith(LANE_CHANGE):
            libsumo.vehicle.setParameter(layout.ego.id, name, f"{value:g}")
    for start in layout.vehicles:
        _insert(start, f"background_{start.body}")
    if layout.signal is not None:
        _set_signal(layout.signal, layout.signal_offset_s)


def hand_over(start: VehicleStart) -> None:
    """Makes a vehicle drive as commanded, whatever is in its way."""
    libsumo.vehicle.setType(start.id, f"adversary_{start.body}")
    for name, value in STEERED.items():  # a change of type leaves the lane-change model as it is
        libsumo.vehicle.setParameter(start.id, f"laneChangeModel.{name}", value)
    libsumo.vehicle.setSpeedMode(start.id, 0)
    libsumo.vehicle.setLaneChangeMode(start.id, 0)


def _insert(start: VehicleStart, type_id: str) -> None:
    route = "_".join(("route", *start.route))
    if route not in libsumo.route.getIDList():
        libsumo.route.add(route, start.route)
    libsumo.vehicle.add(
        start.id,
        route,
        typeID=type_id,
        departLane=str(start.lane),
        departPos=repr(start.position_m),
        departSpeed=repr(start.speed_mps),
    )


def _set_signal(signal: str, offset_s: float) -> None:
    """Puts a fixed-time signal at `offset_s` into its cycle."""
    (logic, *_) = libsumo.trafficlight.getAllProgramLogics(signal)
    durations = [phase.duration for phase in logic.phases]
    left = offset_s % sum(durations)
    for index, duration in enumerate(durations):
        if left < duration:
            libsumo.trafficlight.setPhase(signal, index)
            libsumo.trafficlight.setPhaseDuration(signal, duration - left)
            return
        left -= duration
