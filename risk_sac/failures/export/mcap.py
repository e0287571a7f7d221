"""MCAP with foxglove schemas: actors, measures, moments on one clock; `beside.json` attached."""

import io
import json
import math
from collections import defaultdict
from collections.abc import Iterator
from typing import Any

import foxglove
import numpy as np
from foxglove import Channel, Context, Schema
from foxglove import messages as fox
from foxglove.channels import FrameTransformsChannel, LogChannel, SceneUpdateChannel

from risk_sac.failures.export.formats import BESIDE, Files, beside
from risk_sac.failures.export.recorded import ExportedActor, Recorded
from risk_sac.failures.net import boundaries, colour
from risk_sac.failures.sentence import story
from risk_sac.records import Collision
from risk_sac.world.net import NetLane
from risk_sac.world.types import Floats

MAP, EGO = "map", "ego"  # frames of reference
BLUE, ORANGE, GREY, WHITE = (0.0, 0.447, 0.698), (0.835, 0.369, 0.0), (0.5, 0.5, 0.5), (0.9, 0.9, 0.9)
UNSEEN_ALPHA = 0.35  # of a body that the ego does not know of
ASPHALT = (0.25, 0.25, 0.27)
GROUND = {"lane": ASPHALT, "inside": ASPHALT, "sidewalk": (0.55, 0.55, 0.55), "crossing": (0.8, 0.8, 0.8)}
LIGHTS = {"red": (1, 0, 0), "red_yellow": (1, 0.5, 0), "yellow": (1, 0.9, 0), "green": (0, 0.8, 0), "off": (0.2,) * 3}
MEASURES = "risk_sac.Measures"


def files(failure: Recorded) -> Files:
    """One file."""
    content, context = io.BytesIO(), Context()
    options = foxglove.mcap.MCAPWriteOptions(compression_threads=0)
    with foxglove.open_mcap(content, context=context, writer_options=options) as writer:
        roads = fox.SceneUpdate(entities=[_surface(lane) for lane in failure.net.lanes.values()])
        SceneUpdateChannel("/roads", context=context).log(roads, log_time=0)
        actors = SceneUpdateChannel("/actors", context=context)
        signals = SceneUpdateChannel("/signals", context=context)
        frames, measures = FrameTransformsChannel("/tf", context=context), _measures_channel(failure, context)
        moments = LogChannel("/moments", context=context)
        said = defaultdict[int, list[str]](list)
        for frame, what in _moments(failure):
            said[frame].append(what)
        for frame, time_s in enumerate(failure.time_s):
            at = round(float(time_s) * 1e9)
            actors.log(_actors(failure, frame), log_time=at)
            frames.log(_ego_frame(failure, frame), log_time=at)
            measures.log(_measured(failure, frame), log_time=at)
            if failure.heads:
                signals.log(_signals(failure, frame), log_time=at)
            for what in said[frame]:
                stamp = _stamp(failure, frame)
                moment = fox.Log(timestamp=stamp, level=fox.LogLevel.Info, message=what, name="risk-sac")
                moments.log(moment, log_time=at)
        told = {"id": failure.name, "digest": failure.manifest.digest, "code": failure.manifest.code, "beside": BESIDE}
        writer.write_metadata("failure", told)
        writer.attach(log_time=0, create_time=0, name=BESIDE, media_type="application/json", data=beside(failure, ()))
    return {f"{failure.name}.mcap": content.getvalue()}


def _stamp(failure: Recorded, frame: int) -> fox.Timestamp:
    return fox.Timestamp.from_epoch_secs(float(failure.time_s[frame]))


def _paint(tone: tuple[float, float, float], alpha: float = 1.0) -> fox.Color:
    red, green, blue = tone
    return fox.Color(r=red, g=green, b=blue, a=alpha)


def _turned(heading_rad: float) -> fox.Quaternion:
    return fox.Quaternion(x=0, y=0, z=math.sin(heading_rad / 2), w=math.cos(heading_rad / 2))


def _surface(lane: NetLane) -> fox.SceneEntity:
    raised_m = {"lane": 0.0, "inside": 0.01, "sidewalk": 0.0, "crossing": 0.02}[lane.use]
    left, right = (_points(edge, np.array(lane.height_m) + raised_m) for edge in boundaries(lane.centre, lane.width_m))
    strip = [corner for pair in zip(left, right, strict=True) for corner in pair]
    corners = [strip[k + step] for k in range(len(strip) - 2) for step in (0, 1, 2)]
    area = fox.TriangleListPrimitive(points=corners, color=_paint(GROUND[lane.use]))
    return fox.SceneEntity(
        frame_id=MAP, id=lane.id, triangles=[area], lines=[] if lane.use != "lane" else [_line(left), _line(right)]
    )


def _line(points: list[fox.Point3]) -> fox.LinePrimitive:
    return fox.LinePrimitive(
        type=fox.LinePrimitiveLineType.LineStrip, points=points, thickness=0.12, color=_paint(WHITE)
    )


def _points(points: Floats, height_m: Floats) -> list[fox.Point3]:
    return [fox.Point3(x=x, y=y, z=z) for x, y, z in np.column_stack((points, height_m)).tolist()]


def _actors(failure: Recorded, frame: int) -> fox.SceneUpdate:
    here = [actor for actor in failure.actors if frame < len(actor.time_s)]
    gone = [actor for actor in failure.actors if frame == len(actor.time_s)]
    deletions = [fox.SceneEntityDeletion(type=fox.SceneEntityDeletionType.MatchingId, id=actor.id) for actor in gone]
    return fox.SceneUpdate(entities=[_body(failure, actor, frame) for actor in here], deletions=deletions)


def _body(failure: Recorded, actor: ExportedActor, frame: int) -> fox.SceneEntity:
    column = failure.actors.index(actor)
    seen = column == 0 or bool(failure.series["visible"][frame, column])
    tone = BLUE if column == 0 else ORANGE if column == failure.striker else GREY
    paint = _paint(tone, 1.0 if seen else UNSEEN_ALPHA)
    person, height = actor.body.shape == "person", actor.body.height_m
    x, y, z, heading = (float(values[frame]) for values in (actor.x_m, actor.y_m, actor.z_m, actor.heading_rad))
    pose = fox.Pose(position=fox.Vector3(x=x, y=y, z=z + height / 2), orientation=_turned(heading))
    size = fox.Vector3(x=actor.length_m, y=actor.width_m, z=height)
    above = fox.Pose(position=fox.Vector3(x=x, y=y, z=z + height + 0.8), orientation=_turned(0.0))
    speed = f"{actor.speed_mps[frame]:.3f}"
    told = {
        "body": actor.body.name,
        "role": actor.role.name.lower(),
        "speed_mps": speed,
        "seen_by_ego": str(seen).lower(),
    }
    cube = fox.CubePrimitive(pose=pose, size=size, color=paint)
    cylinder = fox.CylinderPrimitive(pose=pose, size=size, bottom_scale=1, top_scale=1, color=paint)
    return fox.SceneEntity(
        timestamp=_stamp(failure, frame),
        frame_id=MAP,
        id=actor.id,
        metadata=[fox.KeyValuePair(key=key, value=value) for key, value in told.items()],
        cubes=[] if person else [cube],
        cylinders=[cylinder] if person else [],
        texts=[fox.TextPrimitive(pose=above, billboard=True, font_size=0.8, text=actor.id, color=paint)],
    )


def _signals(failure: Recorded, frame: int) -> fox.SceneUpdate:
    entities = []
    for lane in failure.net.lanes.values():
        for place, head in enumerate(lane.heads):
            shown = colour(chr(failure.heads[head.signal][frame, head.index]))
            x, y, z = (float(value) for value in (*lane.centre[-1], lane.height_m[-1]))
            pose = fox.Pose(position=fox.Vector3(x=x, y=y, z=z + 4.0 + 0.7 * place), orientation=_turned(0.0))
            ball = fox.SpherePrimitive(pose=pose, size=fox.Vector3(x=0.6, y=0.6, z=0.6), color=_paint(LIGHTS[shown]))
            name = f"{head.signal}_{head.index}"
            entities.append(fox.SceneEntity(timestamp=_stamp(failure, frame), frame_id=MAP, id=name, spheres=[ball]))
    return fox.SceneUpdate(entities=entities)


def _ego_frame(failure: Recorded, frame: int) -> fox.FrameTransforms:
    ego = failure.ego
    moved = fox.FrameTransform(
        timestamp=_stamp(failure, frame),
        parent_frame_id=MAP,
        child_frame_id=EGO,
        translation=fox.Vector3(x=float(ego.x_m[frame]), y=float(ego.y_m[frame]), z=float(ego.z_m[frame])),
        rotation=_turned(float(ego.heading_rad[frame])),
    )
    return fox.FrameTransforms(transforms=[moved])


def _measures_channel(failure: Recorded, context: Context) -> Channel:
    """JSON, whose schema names every number and its unit."""
    number: dict[str, Any] = {"type": ["number", "null"]}
    names = ["ego_speed_mps", "ego_accel_mps2", "striker_distance_m", "striker_ttc_s", "least_ttc_s", "soft_min"]
    properties: dict[str, Any] = dict.fromkeys(names, number) | {"striker_seen": {"type": "boolean"}}
    requirements = {str(name): number for name in failure.series["requirements"]}
    properties |= {"robustness": {"type": "object", "properties": requirements}}
    schema = {"title": MEASURES, "type": "object", "properties": properties}
    described = Schema(name=MEASURES, encoding="jsonschema", data=json.dumps(schema).encode())
    return Channel("/measures", message_encoding="json", schema=described, context=context)


def _measured(failure: Recorded, frame: int) -> dict[str, object]:
    series, striker = failure.series, failure.striker
    names = [str(name) for name in series["requirements"]]
    return {
        "ego_speed_mps": _number(failure.ego.speed_mps[frame]),
        "ego_accel_mps2": _number(failure.ego.accel_mps2[frame]),
        "striker_distance_m": None if striker is None else _number(series["distance_m"][frame, striker]),
        "striker_ttc_s": None if striker is None else _number(series["ttc_s"][frame, striker]),
        "least_ttc_s": _number(series["least_ttc_s"][frame]),
        "soft_min": _number(series["soft_min"][frame]),
        "striker_seen": striker is not None and bool(series["visible"][frame, striker] == 1),
        "robustness": {name: _number(series["robustness"][frame, i]) for i, name in enumerate(names)},
    }


def _number(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _moments(failure: Recorded) -> Iterator[tuple[int, str]]:
    released = round(failure.released_s * 10)
    yield released, "the adversaries are released"
    if isinstance(failure.violation, Collision):
        began = released + round(failure.violation.judgement.conflict_s * 10)
        if 0 <= began < failure.moment:
            yield began, f"the conflict begins: {failure.violation.kind}"
    yield failure.moment, f"the ego {failure.violation.event}: {story(failure.series, failure.violation)}"
