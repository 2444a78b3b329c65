"""What viewers of the Foxglove family find in a recording: frames, models, markers."""

import made_run
import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

from seerob.core.shapes import Mesh
from seerob.core.transforms import rotation_from_axis_angle, rotation_from_wxyz
from seerob.description.shapes.glb import glb_bytes
from seerob.outputs.sinks.recorder import Recorder


def record(folder, n, *, meshes=made_run.MESHES):
    with Recorder(lossless=True).open(made_run.scene(), meshes, {}, folder) as writer:
        for k in range(n):
            writer.write(made_run.snapshot(k), ())
    return folder / "run.mcap"


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    return record(tmp_path_factory.mktemp("foxglove"), 150)


def test_models_stand_upright_in_a_viewer_that_turns_gltf(path):
    with path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        message = next(iter(reader.iter_decoded_messages(topics=["/scene"]))).decoded_message
    q = message.entities[0].models[0].pose.orientation
    viewer = rotation_from_axis_angle([1, 0, 0], np.pi / 2)
    np.testing.assert_allclose(rotation_from_wxyz([q.w, q.x, q.y, q.z]) @ viewer, np.eye(3), atol=1e-15)


def test_every_marker_has_a_shape_in_a_viewer(path):
    with path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        updates = [m.decoded_message for m in reader.iter_decoded_messages(topics=["/markers"])]
    entity = next(e for e in updates[3].entities if e.id == "tool speed")
    assert (len(entity.lines), len(entity.spheres), len(entity.cubes), len(entity.triangles)) == (1, 2, 1, 1)
    assert [t.text for t in entity.texts] == ["v", made_run.HOSTILE]
    assert (entity.spheres[0].size.x, entity.spheres[1].size.z) == (0.4, 0.6)
    assert {e.id for e in updates[-1].entities} == {r.name for r in made_run.snapshot(0).results}


def test_a_viewer_finds_every_frame_and_time_never_turns_back(path):
    """The rules that Foxglove's panels rely on: one tree of frames, known ones only, times in order."""
    times, parents, used = {}, {}, set()
    with path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        for _, channel, message, decoded in reader.iter_decoded_messages(
            topics=["/tf", "/scene", "/markers"], log_time_order=False
        ):
            assert message.log_time >= times.get(channel.topic, 0)
            times[channel.topic] = message.log_time
            assert message.publish_time <= message.log_time
            if channel.topic == "/tf":
                names = [t.child_frame_id for t in decoded.transforms]
                assert len(set(names)) == len(names)
                for t in decoded.transforms:
                    assert t.child_frame_id
                    assert parents.setdefault(t.child_frame_id, t.parent_frame_id) == t.parent_frame_id
                    stamp = t.timestamp.seconds * 1_000_000_000 + t.timestamp.nanos
                    assert stamp == message.log_time
                    q = t.rotation
                    assert q.w**2 + q.x**2 + q.y**2 + q.z**2 == pytest.approx(1, abs=1e-6)
            else:
                ids = [e.id for e in decoded.entities]
                assert len(set(ids)) == len(ids)
                used |= {e.frame_id for e in decoded.entities}
    roots = set(parents.values()) - set(parents)
    assert roots == {"world"}
    assert used <= set(parents) | roots
    for start in parents:  # no frame is its own ancestor
        frame, seen = start, set()
        while frame in parents:
            assert frame not in seen
            seen.add(frame)
            frame = parents[frame]
    assert set(times) == {"/tf", "/scene", "/markers"}


def test_what_is_translucent_is_so_in_a_viewer_too(tmp_path):
    area = Mesh(*made_run.box(), (0.9, 0.8, 0.2, 0.25))
    meshes = {"a" * 64: glb_bytes([area]), "c" * 64: glb_bytes([Mesh(*made_run.box(), (0.1, 0.2, 0.3, 1.0))])}
    file = record(tmp_path, 1, meshes=meshes)
    with file.open("rb") as opened:
        reader = make_reader(opened, decoder_factories=[DecoderFactory()])
        (scene,) = (m.decoded_message for m in reader.iter_decoded_messages(topics=["/scene"]))
    models = {e.id: e.models[0] for e in scene.entities}
    assert models["ur10/base"].override_color
    assert models["ur10/base"].color.a == pytest.approx(0.25)
    assert models["ur10/base"].color.r == pytest.approx(0.9, abs=1e-5)
    assert not models["table"].override_color
