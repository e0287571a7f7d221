"""Converts the seam's records to the protocol's messages and back, for both ends of a connection."""

from dataclasses import asdict
from typing import Any

import numpy as np

from risk_sac.egos.remote import ego_pb2
from risk_sac.egos.seam import Command, Control, EpisodeStart, Perceived, Trajectory, Vehicle
from risk_sac.world.types import (
    ACCEL,
    HEADING,
    LENGTH,
    OFFSET,
    SPEED,
    VX,
    VY,
    WIDTH,
    Floats,
    Lane,
    Road,
    Signal,
    StopLine,
    X,
    Y,
)

PROTOCOL = 2
SERVICE = "risk_sac.egos.v2.Ego"
METHODS = {  # request and reply
    "Start": (ego_pb2.StartRequest, ego_pb2.StartReply),
    "Act": (ego_pb2.Observation, ego_pb2.Command),  # a stream of each
    "Close": (ego_pb2.CloseRequest, ego_pb2.CloseReply),
}
ROWS = {"x_m": X, "y_m": Y, "heading_rad": HEADING, "vx_mps": VX, "vy_mps": VY, "length_m": LENGTH, "width_m": WIDTH}
PATH = tuple(field.name for field in ego_pb2.Path.DESCRIPTOR.fields)  # in the order of the rows
VEHICLE = tuple(field.name for field in ego_pb2.Vehicle.DESCRIPTOR.fields)


def start_request(episode: EpisodeStart, session: str) -> Any:
    """Returns the StartRequest of an episode."""
    return ego_pb2.StartRequest(
        protocol=PROTOCOL,
        session=session,
        seed=episode.seed,
        net=episode.net,
        route=episode.route,
        step_s=episode.step_s,
        vehicle=asdict(episode.vehicle),
        road={
            "lane": [_lane_fields(lane) for lane in episode.road.lanes],
            "stop_line": [line._asdict() for line in episode.road.stop_lines],
        },
    )


def episode_of(request: Any) -> EpisodeStart:
    """Returns the episode of a StartRequest."""
    return EpisodeStart(
        seed=request.seed,
        net=request.net,
        route=tuple(request.route),
        vehicle=Vehicle(**{name: getattr(request.vehicle, name) for name in VEHICLE}),
        step_s=request.step_s,
        road=Road(
            tuple(_lane_of(lane) for lane in request.road.lane),
            tuple(
                StopLine(**{name: getattr(line, name) for name in StopLine._fields}) for line in request.road.stop_line
            ),
        ),
    )


def _lane_fields(lane: Lane) -> dict[str, Any]:
    fields = lane._asdict()
    fields["x_m"], fields["y_m"] = fields.pop("line").tolist()
    return fields


def _lane_of(message: Any) -> Lane:
    line = np.array((message.x_m, message.y_m))
    plain = {name: getattr(message, name) for name in Lane._fields if name not in ("line", "successors")}
    return Lane(line=line, successors=tuple(message.successors), **plain)


def observation(perceived: Perceived, session: str, new_path: bool) -> Any:
    """Returns the Observation of what the ego perceives."""
    p = perceived
    rows = {name: p.state[row].tolist() for name, row in ROWS.items()}
    return ego_pb2.Observation(
        session=session,
        time_s=p.time_s,
        actors=ego_pb2.Actors(id=p.ids, kind=p.kind.tolist(), **rows),
        path=ego_pb2.Path(**dict(zip(PATH, p.path.tolist(), strict=False))) if new_path else None,
        station_m=p.station_m,
        offset_m=p.offset_m,
        signal=int(p.signal),
        stop_line_m=p.stop_line_m,
        speed_mps=p.state[SPEED, 0],
        accel_mps2=p.state[ACCEL, 0],
        signals=map(int, p.signals),
    )


def perceived_of(message: Any, path: Floats) -> Perceived:
    """Returns what the ego perceives; `path` is the latest one that was sent."""
    actors = message.actors
    state = np.full((WIDTH + 1, len(actors.id)), np.nan)
    state[[*ROWS.values()], :] = [getattr(actors, name) for name in ROWS]
    state[SPEED] = np.hypot(state[VX], state[VY])
    state[[SPEED, ACCEL, OFFSET], 0] = message.speed_mps, message.accel_mps2, message.offset_m
    return Perceived(
        time_s=message.time_s,
        ids=tuple(actors.id),
        kind=np.array(actors.kind, dtype=np.int8),
        state=state,
        path=path,
        station_m=message.station_m,
        offset_m=message.offset_m,
        signal=Signal(message.signal),
        stop_line_m=message.stop_line_m,
        signals=tuple(map(Signal, message.signals)),
    )


def path_of(message: Any) -> Floats:
    """Returns the rows of `risk_sac.egos.driving`, and below them cosine and sine of the heading."""
    heading = np.array(message.heading_rad)
    return np.array([*(getattr(message, name) for name in PATH), np.cos(heading), np.sin(heading)])


def command_message(command: Command, time_s: float) -> Any:
    """Returns the Command that answers the observation of a time."""
    if isinstance(command, Control):
        return ego_pb2.Command(control=command._asdict(), time_s=time_s)
    return ego_pb2.Command(trajectory=command._asdict(), time_s=time_s)


def command_of(message: Any) -> Command | None:
    """Returns what the ego commands; None if it is neither control nor trajectory."""
    if message.HasField("control"):
        return Control(message.control.accel_mps2, message.control.steering_rad)
    if message.HasField("trajectory"):
        return Trajectory(*(np.array(getattr(message.trajectory, name)) for name in Trajectory._fields))
    return None
