"""MCAP, read by the mcap package and the file's own schemas."""

import io
import json
from collections import defaultdict
from collections.abc import Callable
from typing import Any, cast

import numpy as np
import pytest
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from mcap.reader import make_reader

from risk_sac.failures.export.formats import FormatName
from tests.exports.conftest import CM
from tests.exports.make_examples import FAMILIES


def read(content: bytes) -> tuple[dict[str, list[tuple[int, Any]]], dict[str, bytes]]:
    """Messages by topic, each with its time, and attachments by name."""
    found: dict[str, list[tuple[int, Any]]] = defaultdict(list)
    decoders: dict[int, Callable[[bytes], Any]] = {}
    with io.BytesIO(content) as stream:
        reader = make_reader(stream, validate_crcs=True)
        for schema, channel, message in reader.iter_messages():
            assert schema is not None
            if schema.id not in decoders:
                decoders[schema.id] = decoder(schema)
            found[channel.topic].append((message.log_time, decoders[schema.id](message.data)))
        return found, {each.name: each.data for each in reader.iter_attachments()}


def decoder(schema: Any) -> Callable[[bytes], Any]:
    if schema.encoding == "jsonschema":
        return json.loads
    assert schema.name.startswith("foxglove.")
    pool = descriptor_pool.DescriptorPool()
    for file in descriptor_pb2.FileDescriptorSet.FromString(schema.data).file:
        pool.Add(file)
    kind = message_factory.GetMessageClass(pool.FindMessageTypeByName(schema.name))
    return cast("Callable[[bytes], Any]", kind.FromString)


@pytest.mark.parametrize("family", FAMILIES)
def test_bodies_and_measures_come_back(family, exported, failure):
    recorded = failure(family)
    topics, attached = read(exported(family, FormatName.MCAP).read_bytes())
    assert len(topics["/actors"]) == len(topics["/measures"]) == len(topics["/tf"]) == recorded.frames
    actors = {actor.id: actor for actor in recorded.actors}
    for frame, (time_ns, scene) in enumerate(topics["/actors"]):
        assert time_ns == round(frame * 1e8)
        assert {entity.id for entity in scene.entities} == {a.id for a in actors.values() if frame < len(a.time_s)}
        for entity in scene.entities:
            actor, (body,) = actors[entity.id], [*entity.cubes, *entity.cylinders]
            place = (body.pose.position.x, body.pose.position.y)
            assert np.abs(np.subtract(place, (actor.x_m[frame], actor.y_m[frame]))).max() < CM
            assert (body.size.x, body.size.y) == (actor.length_m, actor.width_m)
    measured = [message for _, message in topics["/measures"]]
    names = [str(name) for name in recorded.series["requirements"]]
    robustness = [[message["robustness"][name] for name in names] for message in measured]
    np.testing.assert_allclose(robustness, recorded.series["robustness"])
    assert len(topics["/roads"][0][1].entities) == len(recorded.net.lanes)
    assert topics["/moments"][-1][1].message.startswith(f"the ego {recorded.violation.event}: ")
    assert json.loads(attached["beside.json"])["failure"] == recorded.name
    assert bool(topics["/signals"]) == bool(recorded.heads)
