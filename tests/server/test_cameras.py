"""Network cameras: MJPEG as cameras send it, and as none should; then the page, and a recording."""

import io
import threading
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import httpx
import numpy as np
import pytest
from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from mcap.reader import make_reader
from msgspec.structs import replace
from PIL import Image

from seerob.app.server.live import Live
from seerob.app.server.serving import Server
from seerob.core.snapshot import CameraInfo, Place
from seerob.devices.live.camera_pictures import CameraPictures, Cameras, allowed
from seerob.outputs.sinks.recorder import Recorder
from seerob.protocols import ProtocolError
from seerob.protocols.links.mjpeg import LARGEST, boundary, pictures, size_of
from server.frames import MESHES, scene, snapshot

SIZE = (64, 48)


def jpeg(shade, size=SIZE, **options):
    held = io.BytesIO()
    Image.new("RGB", size, (shade, 40, 90)).save(held, "JPEG", **options)
    return held.getvalue()


def stream(parts, *, length=True, end=b"--b--\r\n"):
    out = b""
    for part in parts:
        said = f"Content-Length: {len(part)}\r\n".encode() if length else b""
        out += b"--b\r\nContent-Type: image/jpeg\r\n" + said + b"\r\n" + part + b"\r\n"
    return io.BytesIO(out + end)


@pytest.mark.parametrize("options", [{}, {"progressive": True}, {"comment": b"x" * 900}, {"quality": 5}])
def test_the_size_of_a_jpeg_is_what_pillow_wrote(options):
    assert size_of(jpeg(10, (321, 123), **options)) == (321, 123)
    assert size_of(b"\x89PNG") is None
    for cut in range(0, 40, 3):
        assert size_of(jpeg(10)[:cut]) is None


@pytest.mark.parametrize("length", [True, False])
def test_pictures_come_one_after_another_with_and_without_a_length(length):
    sent = [jpeg(shade) for shade in (10, 100, 200)]
    assert list(pictures(stream(sent, length=length), b"--b")) == sent
    assert list(pictures(stream(sent, length=length, end=b""), b"--b")) == sent


def test_the_boundary_is_read_as_cameras_say_it():
    assert boundary('multipart/x-mixed-replace; boundary="--b"') == b"--b"
    assert boundary("Multipart/X-Mixed-Replace;charset=x; boundary=b") == b"--b"
    with pytest.raises(ProtocolError, match="text/html"):
        boundary("text/html")


@pytest.mark.parametrize(
    "bytes_",
    [
        b"--b\r\nContent-Length: 99999999999\r\n\r\nx",
        b"--b\r\nContent-Length: -1\r\n\r\nx",
        b"--b\r\nContent-Length: 4\r\n\r\n<htm\r\n",
        b"--b\r\n" + b"X: y\r\n" * 200,
        b"x\n" * 1000,
        b"--b\r\n\r\n\xff\xd8" + b"\n" * (LARGEST + 70_000),
    ],
)
def test_what_is_too_long_or_no_picture_is_refused(bytes_):
    with pytest.raises(ProtocolError):
        list(pictures(io.BytesIO(bytes_), b"--b"))


@contextmanager
def served(answer):
    """An HTTP server of this machine whose every answer ``answer(handler)`` writes."""

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self):
            answer(self)

        def log_message(self, *_):
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    server.daemon_threads = True
    thread = threading.Thread(target=server.serve_forever, args=(0.05,))
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_address[1]}/video"
    finally:
        server.shutdown()
        server.server_close()
        thread.join()


def films(shades, over, size=SIZE):
    def answer(handler):
        handler.send_response(200)
        handler.send_header("Content-Type", "multipart/x-mixed-replace; boundary=b")
        handler.end_headers()
        for shade in shades:
            handler.wfile.write(stream([jpeg(shade, size)], end=b"").getvalue())
        over.wait(60)

    return answer


def newest(camera, known=0):
    """The first picture that is another than the one known, or why there is none."""
    there = threading.Event()
    found = camera.newest(there.set, known)
    if isinstance(found, str) or found.number == known:
        assert there.wait(60)
        found = camera.newest()
    return found


def test_the_newest_picture_is_the_last_one_sent():
    over = threading.Event()
    with served(films((10, 20, 30), over)) as address, CameraPictures(address, SIZE) as camera:
        found = newest(camera)
        while found.number < 3:
            found = newest(camera, found.number)
        assert found.jpeg == jpeg(30)
        over.set()


@pytest.mark.parametrize(
    ("answer", "why"),
    [
        (lambda h: h.send_error(404), "HTTP 404"),
        (lambda h: (h.send_response(302), h.send_header("Location", "/x"), h.end_headers()), "HTTP 302"),
        (lambda h: (h.send_response(200), h.end_headers()), "not with multipart"),
    ],
)
def test_what_is_no_stream_is_said_and_no_redirection_followed(answer, why):
    with served(answer) as address, CameraPictures(address, SIZE) as camera:
        assert why in newest(camera)


def test_pictures_of_another_size_than_the_lens_are_not_shown():
    over = threading.Event()
    with served(films((10,), over, (32, 24))) as address, CameraPictures(address, SIZE) as camera:
        assert "32 × 24 px, and its lens is known for 64 × 48 px" in newest(camera)
        over.set()


def test_nobody_is_connected_to_before_somebody_looks():
    asked = threading.Event()
    with served(lambda h: (asked.set(), h.send_error(404))) as address:
        with CameraPictures(address, SIZE):
            assert not asked.wait(0.3)
        with CameraPictures(address, SIZE, always=True):
            assert asked.wait(60)


@pytest.mark.parametrize(
    ("address", "hosts", "may"),
    [
        ("http://127.0.0.1:81/a", (), True),
        ("http://[::1]:81/a", (), True),
        ("http://localhost/a", (), True),
        ("http://192.0.2.7/a", (), False),
        ("http://192.0.2.7/a", ("192.0.2.7",), True),
        ("http://127.0.0.1.example/a", (), False),
        ("http://cam.example/a", ("Cam.example",), True),
    ],
)
def test_only_this_machine_and_hosts_of_the_command_line_are_connected_to(address, hosts, may):
    assert allowed(address, hosts) is may


def test_a_page_is_given_each_picture_once_and_its_age():
    over = threading.Event()
    with (
        served(films((10, 20), over)) as address,
        CameraPictures(address, SIZE) as camera,
        Server(scene=scene(), meshes=MESHES, feed=Live(), port=0, cameras=Cameras({1: camera}, {})) as server,
        httpx.Client(base_url=server.url, timeout=60) as page,
    ):
        known, got = 0, []
        while known < 2:
            said = page.get(f"/camera/1?after={known}")
            assert said.status_code == 200, said.text
            known = int(said.headers["X-Picture"])
            got.append(said.content)
        assert got[-1] == jpeg(20)
        assert 0 <= float(said.headers["X-Age"]) < 60
        assert said.headers["Cache-Control"] == "no-store"
        assert page.get("/camera/1?after=2").status_code == 204
        for wrong in ("/camera/0", "/camera/1?after=x", "/camera/1?after=-1", "/camera/99999999999999"):
            assert page.get(wrong).status_code == 404
        over.set()


def test_recorded_pictures_are_read_by_foxglove_with_lens_and_place(tmp_path):
    info = CameraInfo(
        name="shelf",
        size=SIZE,
        lens=(50, 51, 32, 24, -0.1, 0, 0, 0, 0),
        place=Place(name="shelf", position=(1, 2, 3)),
    )
    seen = replace(scene(), cameras=(info,))

    waiting = [[("shelf", jpeg(10))], [], [("shelf", jpeg(20))]]

    class Both:
        def taken(self):
            return waiting.pop(0) if waiting else []

    with Recorder().open(seen, MESHES, {}, tmp_path) as writer:
        writer.look(Both())
        for k in range(5):
            writer.write(snapshot(k), ())
    with (tmp_path / "run.mcap").open("rb") as file:
        told = [
            (channel.topic, message.log_time, message.data)
            for _, channel, message in make_reader(file).iter_messages(
                topics=["/cameras/shelf", "/cameras/shelf/lens"]
            )
        ]
    images = [(t, CompressedImage.FromString(data)) for topic, t, data in told if topic == "/cameras/shelf"]
    assert [(t, image.data) for t, image in images] == [(0, jpeg(10)), (20_000_000, jpeg(20))]
    lens = CameraCalibration.FromString(next(data for topic, _, data in told if topic.endswith("lens")))
    assert (lens.width, lens.height, list(lens.K[:3]), lens.D[0]) == (64, 48, [50, 0, 32], -0.1)
    assert {image.frame_id for _, image in images} == {lens.frame_id} == {"camera shelf"}
    assert np.asarray(Image.open(io.BytesIO(images[1][1].data))).shape == (48, 64, 3)
