"""The bridge to a WAMP router, with crossbar as the router and autobahn as the client behind it.

Runs where ``crossbar`` is on the path, or ``CROSSBAR`` names it; the Python beside it runs bridge and client.
"""

import json
import os
import shutil
import socket
import subprocess
import threading
from pathlib import Path

import numpy as np
import pytest

from free_ports import free_port
from seerob.app.server.live import Live
from seerob.app.server.serving import Server
from server.frames import MESHES, scene, snapshot

BRIDGE = Path(__file__).parents[2] / "bridges" / "wamp" / "seerob_wamp.py"
CROSSBAR = os.environ.get("CROSSBAR") or shutil.which("crossbar")
pytestmark = pytest.mark.skipif(
    CROSSBAR is None, reason="no crossbar here: pip install crossbar elsewhere, and set CROSSBAR to its path"
)
CLIENT = """
import asyncio, json, sys
from autobahn.asyncio.component import Component
from autobahn.wamp.exception import ApplicationError

router = Component(transports=[{"url": sys.argv[1], "serializers": ["msgpack"]}], realm="realm1")

@router.on_join
async def joined(session, _):
    heard, enough = [], asyncio.Event()
    def take(message):
        heard.append(message)
        if len(heard) == 3:
            enough.set()
    await session.subscribe(take, "lab.snapshot")
    scene = None
    while scene is None:
        try:
            scene = await session.call("lab.newest.scene")
        except ApplicationError:  # the bridge is not there yet
            await asyncio.sleep(0.1)
    await enough.wait()
    visitors = await session.call("lab.newest.visitors")
    print(json.dumps({"heard": heard, "nodes": [n["name"] for n in scene["nodes"]], "visitors": visitors}))
    session.leave()

asyncio.get_event_loop_policy().set_event_loop(asyncio.new_event_loop())
loop = asyncio.get_event_loop()
loop.run_until_complete(router.start(loop=loop))
"""


def config(port):
    may = {
        "uri": "",
        "match": "prefix",
        "allow": dict.fromkeys(("call", "register", "publish", "subscribe"), True),
    }
    realm = {"name": "realm1", "roles": [{"name": "anonymous", "permissions": [may]}]}
    endpoint = {"type": "tcp", "interface": "127.0.0.1", "port": port}
    transport = {"type": "websocket", "endpoint": endpoint, "serializers": ["msgpack"]}
    return {"version": 2, "workers": [{"type": "router", "realms": [realm], "transports": [transport]}]}


@pytest.fixture(name="router")
def a_router(tmp_path):
    port = free_port(socket.SOCK_STREAM)
    (tmp_path / "config.json").write_text(json.dumps(config(port)))
    command = [CROSSBAR, "start", "--cbdir", tmp_path, "--color", "false"]
    with subprocess.Popen(
        [str(part) for part in command], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    ) as process:
        said = []
        for line in process.stdout:
            said.append(line)
            if "NODE_BOOT_COMPLETE" in line:
                break
        else:
            pytest.fail("".join(said))
        reader = threading.Thread(target=process.stdout.read, daemon=True)
        reader.start()
        yield f"ws://127.0.0.1:{port}/"
        process.terminate()
        reader.join(60)


def test_a_client_of_the_router_hears_what_the_page_hears_and_asks_for_the_newest(router):
    live, over = Live(), threading.Event()

    def publish():
        k = 0
        while not over.wait(0.05):
            live.publish(snapshot(k))
            k += 1

    python = str(Path(CROSSBAR).with_name("python"))
    publisher = threading.Thread(target=publish)
    publisher.start()
    try:
        with Server(scene=scene(), meshes=MESHES, feed=live, port=0) as server:
            page = f"ws://127.0.0.1:{server.port}/ws"
            bridge = subprocess.Popen([python, str(BRIDGE), page, router, "--prefix", "lab"])
            done = subprocess.run(
                [python, "-c", CLIENT, router], capture_output=True, text=True, timeout=120, check=False
            )
            assert done.returncode == 0, done.stderr
            told = json.loads(done.stdout)
            server.stop()
            assert bridge.wait(60) == 0, "the bridge ends with the server"
    finally:
        over.set()
        publisher.join()
    assert told["nodes"] == [node.name for node in scene().nodes]
    assert [one["role"] for one in told["visitors"]["visitors"]] == ["supervisor"]
    for one in told["heard"]:
        truth = snapshot(one["seq"])
        poses = np.frombuffer(truth.poses, "<f4").reshape(-1, 7)
        np.testing.assert_array_equal(np.array(list(one["poses"].values()), np.float32), poses)
        assert [r["name"] for r in one["results"]] == [r.name for r in truth.results]
        assert [r["verdict"] for r in one["results"]] == [r.verdict for r in truth.results]
