"""Clients that are no page: the Python and C# examples, against a server that moves."""

import shutil
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest

from seerob.app.server import certificates
from seerob.app.server.access import Tokens
from seerob.app.server.live import Live
from seerob.app.server.serving import Server
from server.frames import MESHES, scene, snapshot
from server.test_company import Guest

CLIENTS = Path(__file__).parents[2] / "examples" / "clients"
TOKENS = Tokens.made()


@pytest.fixture(name="feed")
def a_feed():
    live, over = Live(), threading.Event()

    def publish():
        k = 0
        while not over.wait(0.02):
            live.publish(snapshot(k))
            k += 1

    publisher = threading.Thread(target=publish)
    publisher.start()
    yield live
    over.set()
    publisher.join()


def lines(command):
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


def test_the_python_client_sees_bodies_results_and_visitors_and_is_seen(feed, tmp_path):
    tls = certificates.own(tmp_path / "tls", "127.0.0.1")
    with Server(scene=scene(), meshes=MESHES, feed=feed, port=0, tokens=TOKENS, tls=tls) as server:
        url = f"wss://127.0.0.1:{server.port}/ws?token={TOKENS.view}"
        said = lines(
            [sys.executable, CLIENTS / "visitor.py", url, "--authority", tls.authority, "--seconds", "1.5"]
        )
        words = {line.split()[0] for line in said}
        assert words == {"body", "result"}
        assert sum(line.startswith("body r/link_") for line in said) == 3
    server.stop()
    assert [v.refused for v in server.visits.take(end=True) if v.event == "left"] == [{}]


def test_two_of_them_see_each_other(feed):
    with (
        Server(scene=scene(), meshes=MESHES, feed=feed, port=0) as server,
        Guest(server, name="Anna") as anna,
    ):
        url = f"ws://127.0.0.1:{server.port}/ws"
        command = [sys.executable, CLIENTS / "visitor.py", url, "--name", "Berta", "--seconds", "2"]
        with subprocess.Popen(list(map(str, command)), stdout=subprocess.PIPE, text=True) as berta:
            known = anna.others(lambda every: any(v.name == "Berta" for v in every.values()))
            number = next(v.id for v in known.values() if v.name == "Berta")
            seen = anna.sees(lambda every: number in every)[number]
            head, left, right = np.frombuffer(seen.poses, "<f4").reshape(3, 7)
            np.testing.assert_allclose([np.hypot(*head[:2]), head[2], right[2]], [2, 1.7, 1.1], atol=1e-5)
            assert np.isnan(left).all()
            assert "visitor 1 Anna" in berta.communicate(timeout=60)[0]


def test_the_csharp_client_compiles_sees_bodies_and_visitors_and_is_seen(feed, tmp_path):
    compiler, runtime = shutil.which("mcs"), shutil.which("mono")
    if not (compiler and runtime):
        pytest.skip("mono is not installed: the C# client is not tried here")
    program = tmp_path / "visitor.exe"
    lines([compiler, "-out:" + str(program), CLIENTS / "SeerobClient.cs", CLIENTS / "Visitor.cs"])
    with (
        Server(scene=scene(), meshes=MESHES, feed=feed, port=0) as server,
        Guest(server, name="Anna") as anna,
    ):
        url = f"ws://127.0.0.1:{server.port}/ws"
        with subprocess.Popen([runtime, program, url, "3"], stdout=subprocess.PIPE, text=True) as process:
            known = anna.others(lambda every: any(v.name == "unity" for v in every.values()))
            number = next(v.id for v in known.values() if v.name == "unity")
            seen = anna.sees(lambda every: number in every)[number]
            np.testing.assert_allclose(
                np.frombuffer(seen.poses, "<f4")[:7], [1, -2, 1.7, 1, 0, 0, 0], atol=1e-6
            )
            said = process.communicate(timeout=60)[0].splitlines()
    assert "visitor 1 Anna" in said
    bodies = [line.split() for line in said if line.startswith("body ")]
    assert [words[1] for words in bodies] == ["r/link_0", "r/link_1", "r/link_2"]
    # Unity's axes (x right, y up, z ahead) of ours (x ahead, y left, z up).
    assert any(
        np.allclose(
            [float(word) for word in bodies[0][2:]],
            np.frombuffer(snapshot(k).poses, "<f4")[:3][[1, 2, 0]] * [-1, 1, 1],
            atol=1e-4,
        )
        for k in range(2000)
    )


def test_the_python_client_is_short():
    text = (CLIENTS / "visitor.py").read_text()
    body = text[text.index("async def walk") :].splitlines()
    assert sum(bool(line.strip()) for line in body) <= 60
