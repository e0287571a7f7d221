"""Between the seam's records and the protocol's messages, in both directions.

The same for both ends, so that an ego that is served (`risk_sac.egos.serve`) drives as it does in our process.
"""

from dataclasses import asdict

import numpy as np

from risk_sac.egos.remote.wire import SCHEMA, Message
from risk_sac.egos.seam import Command, Control, Episode, Perceived, Trajectory, Vehicle
from risk_sac.types import ACCEL, HEADING, LENGTH, OFFSET, SPEED, VX, VY, WIDTH, Floats, Signal, X, Y

PROTOCOL = 2
SERVICE = "risk_sac.egos.v2.Ego"
METHODS = {  # request and reply
    "Start": ("StartRequest", "StartReply"),
    "Act": ("Observation", "Command"),  # a stream of each
    "Close": ("CloseRequest", "CloseReply"),
}
ROWS = {"x_m": X, "y_m": Y, "heading_rad": HEADING, "vx_mps": VX, "vy_mps": VY, "length_m": LENGTH, "width_m": WIDTH}
PATH = tuple(field.name for field in SCHEMA["Path"])  # in the order of the rows


def start_request(episode: Episode, session: str) -> Message:
    """The beginning of an episode."""
    return {"protocol": PROTOCOL, "session": session, **asdict(episode)}


def episode_of(request: Message) -> Episode:
    """What the ego is told."""
    return Episode(
        seed=request["seed"],
        net=request["net"],
        route=tuple(request["route"]),
        vehicle=Vehicle(**request["vehicle"]),
        step_s=request["step_s"],
    )


def observation(perceived: Perceived, session: str, new_path: bool) -> Message:
    """What the ego perceives."""
    p = perceived
    return {
        "session": session,
        "time_s": p.time_s,
        "actors": {"id": p.ids, "kind": p.kind.tolist()} | {name: p.state[row] for name, row in ROWS.items()},
        "path": dict(zip(PATH, p.path, strict=False)) if new_path else None,
        "station_m": p.station_m,
        "offset_m": p.offset_m,
        "signal": int(p.signal),
        "stop_line_m": p.stop_line_m,
        "speed_mps": p.state[SPEED, 0],
        "accel_mps2": p.state[ACCEL, 0],
    }


def perceived_of(message: Message, path: Floats) -> Perceived:
    """What the ego perceives; `path` is the latest that was told."""
    actors = message["actors"]
    state = np.full((WIDTH + 1, len(actors["id"])), np.nan)
    state[[*ROWS.values()], :] = [actors[name] for name in ROWS]
    state[SPEED] = np.hypot(state[VX], state[VY])
    state[[SPEED, ACCEL, OFFSET], 0] = message["speed_mps"], message["accel_mps2"], message["offset_m"]
    return Perceived(
        time_s=message["time_s"],
        ids=tuple(actors["id"]),
        kind=np.array(actors["kind"], dtype=np.int8),
        state=state,
        path=path,
        station_m=message["station_m"],
        offset_m=message["offset_m"],
        signal=Signal(message["signal"]),
        stop_line_m=message["stop_line_m"],
    )


def path_of(message: Message) -> Floats:
    """The rows of `risk_sac.egos.road`, and cosine and sine of the heading below them."""
    heading = np.array(message["heading_rad"])
    return np.array([*(message[name] for name in PATH), np.cos(heading), np.sin(heading)])


def command_message(command: Command, time_s: float) -> Message:
    """What the ego answers to the observation of a time."""
    return {"control" if isinstance(command, Control) else "trajectory": command._asdict(), "time_s": time_s}


def command_of(message: Message) -> Command | None:
    """What the ego answered; None if it is neither control nor trajectory."""
    if "control" in message:
        return Control(**message["control"])
    if "trajectory" in message:
        return Trajectory(**{name: np.array(row) for name, row in message["trajectory"].items()})
    return None
