"""PLCs and robots through OPC UA, over real sockets: values, units, doubts, certificates, restarts."""

from __future__ import annotations

import asyncio
import datetime
import math
import time
from contextlib import ExitStack
from uuid import UUID

import numpy as np
import pytest

from reached import asked, reached

pytest.importorskip("asyncua")

from live_story import Story, listening, lived, wait_for
from made_cell import made
from relay import Stream
from seerob.app.emulators.opcua import URI, Emulated, OpcuaServer
from seerob.core.errors import InputError, SeerobError
from seerob.core.samples import JointSample, Quality, SignalSample
from seerob.devices.live.device_clock import RESTART_HOLD
from seerob.devices.live.listening import Listener
from seerob.devices.sources.opcua import Opcua
from seerob.devices.sources.opcua_robot import OpcuaRobot, another_robot
from seerob.devices.variables.live_source import Change, Picture
from seerob.protocols.plc.opcua_client import (
    CLOCK_STANDS,
    Address,
    Security,
    address,
    browse_name,
    node_name,
    number,
    unit,
    written,
)
from seerob.protocols.plc.opcua_robotics import Robot, natural
from seerob.workstation.source import Target
from seerob.workstation.variables import UNITS, Kind, Variable

"""One server for all: starting one takes seconds."""

HOME, AMPLITUDE = np.array([0, -1.2, 1.4, -1.5, -1.5, 0]), np.array([0.5, 0.3, -0.3, 0.4, -0.4, 0.5])


def motion(t):
    return tuple((HOME + AMPLITUDE * np.sin(t)).tolist()), tuple((AMPLITUDE * np.cos(t)).tolist())


PLC = {"Belt/speed": Emulated(lambda t: 250.0, "mm/s"), "Belt/running": Emulated(lambda t: True)}
SPEED = Variable(
    name="belt/speed", source="plc", unit="mm/s", address={"browse": [f"{URI}|Belt", f"{URI}|speed"]}
)
RUNS = Variable(name="belt/runs", source="plc", type=Kind.BOOL, address=f"nsu={URI};s=Belt/running")
GONE = Variable(name="gone", source="plc", unit="1", address=f"nsu={URI};s=Gone")
OTHER = Variable(name="other", source="plc", unit="m/s", address=f"nsu={URI};s=Belt/speed")


def target(*variables, folder=""):
    return Target(
        name="", joints=(), units=(), lower=(), upper=(), velocity=(), variables=variables, folder=str(folder)
    )


@pytest.fixture(autouse=True)
def patience(monkeypatch):
    """A machine under load answers late."""
    monkeypatch.setattr("seerob.devices.live.listening.ASK_WITHIN", 30.0)


@pytest.fixture(scope="module")
def server():
    """A PLC with a robot: starting one takes seconds."""
    found = OpcuaServer(PLC, {"R1": motion, "R2": motion}, outputs=("Twin/fast",))
    found.load, found.model = 0.0, "emulated UR10"
    with found:
        yield found


def good(heard, name="belt/speed"):
    return bool(heard) and name in heard[-1].values and name not in heard[-1].doubts


def test_variables_are_subscribed_and_stand_until_they_change(server):
    with listening(Opcua(name="plc", url=server.url), target(SPEED, RUNS, GONE, OTHER)) as heard:
        wait_for(lambda: good(heard) and good(heard, "belt/runs"))
        assert heard[-1].values == {"belt/speed": 0.25, "belt/runs": True}
        assert "does not exist" in heard[-1].doubts["gone"]
        assert "states the unit mm/s, the dictionary m/s" in heard[-1].doubts["other"]
        # Nothing changes, and yet it stands.
        count = len(heard)
        wait_for(lambda: len(heard) > count + 15)
        assert good(heard)
        server.bad.add("Belt/speed")
        wait_for(lambda: "BadSensorFailure" in heard[-1].doubts.get("belt/speed", ""))
        server.bad.clear()
        wait_for(lambda: good(heard))


def test_what_arrives_late_is_as_old_as_the_newest_question_that_was_answered(server):
    """The server says that something changed, and nobody would see that it said so half a second ago."""
    wire = Stream(server.port)
    try:
        with listening(Opcua(name="plc", url=f"opc.tcp://127.0.0.1:{wire.port}"), target(SPEED)) as heard:
            wait_for(lambda: good(heard) and heard[-1].ages.get("belt/speed", 0.0) < 0.3)
            wire.late = 0.5
            wait_for(lambda: time.monotonic() - heard[-1].t + heard[-1].ages["belt/speed"] > 0.5)
            end = time.monotonic() + 1.0
            while time.monotonic() < end:
                picture = heard[-1]
                assert time.monotonic() - picture.t + picture.ages["belt/speed"] > 0.49
                time.sleep(0.01)
    finally:
        wire.close()


def test_values_that_are_played_again_over_a_new_connection_are_not_relied_on(monkeypatch):
    """By a server of another maker that says in the place of the first one what that one said, and when."""
    from asyncua import ua

    from foreign_opcua import URI as MAKER
    from foreign_opcua import foreign_opcua

    monkeypatch.setattr("seerob.devices.live.listening.FIRST_PAUSE", 0.05)
    way = Variable(name="way", source="plc", unit="m", address=f"nsu={MAKER};s=way", timeout=60)
    began = datetime.datetime.now(datetime.UTC).replace(tzinfo=None)
    said = [(0.01 * k, began + datetime.timedelta(seconds=0.05 * k)) for k in range(40)]

    def words(k):
        return ua.DataValue(ua.Variant(said[k][0], ua.VariantType.Double), SourceTimestamp=said[k][1])

    nodes = []

    def made(server):
        index = server.register_namespace(MAKER)
        node = server.nodes.objects.add_variable(f"ns={index};s=way", f"{index}:way", 0.0)
        node.write_value(words(0))
        nodes.append(node)

    def tells(heard, since):
        for k in range(since, len(said)):
            nodes[-1].write_value(words(k))
            wait_for(lambda k=k: heard and heard[-1].values.get("way") == said[k][0])

    with ExitStack() as stack:
        with foreign_opcua({}, more=made) as (url, _):
            heard = stack.enter_context(listening(Opcua(name="plc", url=url), target(way)))
            wait_for(lambda: good(heard, "way"))
            tells(heard, 1)
            assert "way" not in heard[-1].doubts
        with foreign_opcua({}, more=made, port=int(url.rstrip("/").rpartition(":")[2])):
            wait_for(lambda: heard[-1].values.get("way") == said[0][0])
            before = len(heard) - 1
            # Longer than a device that was started again is waited for.
            end = time.monotonic() + RESTART_HOLD + 1.0
            tells(heard, 1)
            wait_for(lambda: time.monotonic() > end)
            again = [s for s in list(heard)[before:] if "way" in s.values]
    assert len(again) > 40
    assert {s.doubts.get("way", "")[:27] for s in again} == {"way: says again what it sai"}


@pytest.mark.parametrize("how", ["its clock stands", "it says that it failed"])
def test_a_server_that_hangs_and_answers_is_not_heard(how):
    """One of another maker whose values stand, as they would if all were well."""
    from asyncua import ua

    from foreign_opcua import URI as MAKER
    from foreign_opcua import foreign_opcua

    way = Variable(name="way", source="plc", unit="m", address=f"nsu={MAKER};s=way", timeout=60)
    servers = []
    with ExitStack() as stack:
        url, _ = stack.enter_context(foreign_opcua({"way": 1.0}, more=servers.append))
        with listening(Opcua(name="plc", url=url), target(way)) as heard:
            wait_for(lambda: good(heard, "way") and heard[-1].t > heard[0].t + 4.5)
            (server,) = servers
            if how == "its clock stands":
                server.aio_obj.iserver._time_task_stop = True
            else:
                failed = ua.Variant(int(ua.ServerState.Failed), ua.VariantType.Int32)
                server.get_node("i=2259").write_value(failed)
            time.sleep(CLOCK_STANDS + 2.0)
            newest = heard[-1]
            assert time.monotonic() - newest.t + newest.ages.get("way", 0.0) > 0.9


def test_a_server_that_is_killed_is_found_again(monkeypatch):
    monkeypatch.setattr("seerob.devices.live.listening.FIRST_PAUSE", 0.05)
    monkeypatch.setattr("seerob.devices.live.listening.LONGEST_PAUSE", 0.2)
    server = OpcuaServer({"Belt/speed": PLC["Belt/speed"]}).start()
    try:
        with listening(Opcua(name="plc", url=server.url), target(SPEED)) as heard:
            wait_for(lambda: good(heard))
            server.stop()
            heard.clear()
            server.start()
            wait_for(lambda: good(heard), 60)
    finally:
        server.stop()


def test_browsing_names_what_can_be_written_into_a_dictionary(server, monkeypatch):
    monkeypatch.setattr("seerob.protocols.plc.opcua_client.PATIENCE", 30.0)

    async def found():
        return [node async for node in Opcua(name="plc", url=server.url).browse()]

    nodes = {n.address: n for n in asyncio.run(found())}
    assert nodes[f"nsu={URI};s=Belt/speed"].unit == "mm/s"
    assert nodes[f"nsu={URI};s=Belt/running"].type == "Boolean"
    # What was found is an address.
    with listening(Opcua(name="plc", url=server.url), target(RUNS)) as heard:
        wait_for(lambda: good(heard, "belt/runs"))


def test_a_bool_that_may_be_written_is_and_nothing_else(server, tmp_path):
    source = Opcua(name="plc", url=server.url)

    def write(path, value):
        there = Variable(name="v", source="plc", address=f"nsu={URI};s={path}", type=Kind.BOOL, write=True)
        asyncio.run(source.write(there, value, tmp_path))

    for value in (True, False):
        write("Twin/fast", value)
        wait_for(lambda value=value: server.written["Twin/fast"][-1:] == [value])
    for path, why in (("Belt/running", "refuses"), ("Belt/speed", "only a Boolean"), ("Gone", "exist")):
        with pytest.raises(SeerobError, match=why):
            write(path, True)


def test_at_start_it_is_told_what_the_server_does_not_have_or_states_otherwise(server, tmp_path, monkeypatch):
    monkeypatch.setattr("seerob.devices.variables.live_source.COVER_WITHIN", 30.0)
    same = Variable(name="same", source="plc", unit="mm/s", address=f"nsu={URI};s=Belt/speed")
    scaled = Variable(name="scaled", source="plc", unit="m/s", scale=1e-3, address=same.address)
    wrong = Variable(name="wrong", source="plc", unit="kg", scale=1e-3, address=same.address)
    far = Variable(name="far", source="plc", unit="mm/s", range=(0, 10), address=same.address)
    aim = target(SPEED, RUNS, GONE, OTHER, same, scaled, wrong, far)
    findings = reached(Opcua(name="plc", url=server.url), tmp_path, aim)
    told = {f.subject: f.text for f in findings if f.level == "warning"}
    assert set(told) == {"gone", "other", "wrong", "far"}
    assert "states the unit mm/s, the dictionary kg" in told["wrong"]
    assert "is not in [0, 10]" in told["far"]
    assert "4 of 8 variables are heard at start" in " ".join(f.text for f in findings)


def cell(folder, server, more="", robot="ur10"):
    return made(
        folder,
        f'[[robots]]\nname = "arm"\nmodel = "library:{robot}"\n'
        f'[[sources]]\nkind = "opcua_robot"\nname = "controller"\nrobot = "arm"\nurl = "{server.url}"\n{more}'
        '[[safety]]\nkind = "velocity"\nname = "speed"\nat = "arm"\nlimit = 1.5\n',
    )


def test_a_robot_is_bound_without_a_dictionary(tmp_path, server):
    station = asked(cell(tmp_path, server, 'device = "R1"\n'))
    said = " ".join(f.text for f in station.scene().findings)
    assert "R1, seerob, emulated UR10; axes Axis_1" in said

    def moving(story):
        return [s for s in story.joints() if s.qd is not None]

    # On a busy machine it takes longer until it is bound.
    story = lived(station, Story(150, lambda story: len(moving(story)) > 10))
    joints = moving(story)
    assert len(joints) > 10
    # The server stamps what it writes a little later than the motion that it plays.
    t = np.array([s.t_device for s in joints])
    q, qd = np.array([s.q for s in joints]), np.array([s.qd for s in joints])
    assert np.abs(q - HOME).max() < 0.51
    assert np.abs((q[:, 0] / 0.5) ** 2 + (qd[:, 0] / 0.5) ** 2 - 1).max() < 0.02
    assert (np.diff(t) > 0).mean() > 0.9
    signals = [s for samples in story.heard for s in samples if isinstance(s, SignalSample)]
    assert {"emergency_stop": False, "operational_mode": "AUTOMATIC"}.items() <= signals[-1].values.items()


def test_nothing_is_missing_of_a_robot_that_moves_and_stands_by_turns(tmp_path):
    """Of one that stands the server says nothing but that it is there, five times as seldom."""

    def by_turns(t):
        phase = 2 * np.pi * min(t % 1.0, 0.5) / 0.5
        swing = np.array([0.1, 0, 0, 0, 0, 0])
        speed = swing * 4 * np.pi * np.sin(phase)
        return tuple((HOME + swing * (1 - np.cos(phase))).tolist()), tuple(speed.tolist())

    with OpcuaServer({}, {"R1": by_turns}) as turning:
        story = lived(asked(cell(tmp_path, turning)), Story(400, lambda story: len(story.joints()) > 50))
    assert not any("missing" in result.reason for s in story.snapshots for result in s.results)
    assert len(story.joints()) > 50


def test_what_a_controller_has_at_its_flange_and_which_robot_it_is_are_said(server):
    """4 kg that it has picked up; and the twin of another robot."""
    axes = {"joints": tuple("abcdef"), "units": ("rad",) * 6}
    source = OpcuaRobot(robot="arm", url=server.url, device="R1")
    with listening(source, Target(name="arm", model="library:ur5e", **axes)) as heard:

        def joints():
            return [s for s in tuple(heard) if isinstance(s, JointSample)]

        wait_for(lambda: joints() and joints()[-1].payload == 0.0)
        server.load = 4.0
        wait_for(lambda: joints()[-1].payload == 4.0)
        server.load = 0.0
    said = "the server says that its robot is emulated UR10, and the twin is library:ur5e"
    assert all(s.reason and s.quality is not Quality.GOOD for s in joints())
    assert any(said in s.reason for s in joints())


@pytest.mark.parametrize(
    ("said", "own", "told"),
    [
        ("UR10e", "library:ur10e", False),
        ("UR10e", "library:ur10", True),
        ("LBR iiwa 14 R820", "library:iiwa14", False),
        ("LBR iiwa 7 R800", "library:iiwa14", True),
        ("M1013", "library:doosan_m1013", False),
        ("Niryo One", "library:niryo_one", False),
        ("Milestone 3", "library:ur5e", False),  # of another maker: nothing is known
        ("", "library:ur5e", False),
        ("UR5e", "own.urdf", False),
    ],
)
def test_the_model_that_a_server_names(said, own, told):
    robot = Robot("R1", "Cell", (), {"Model": said})
    assert bool(another_robot(robot, Target(name="arm", model=own))) is told
    assert another_robot(robot, None) == ""


def test_units_are_required_and_never_guessed(tmp_path):
    with OpcuaServer(robots={"R1": motion}, axis_unit="") as silent:
        with pytest.raises(InputError, match="Axis_1 states no unit"):
            cell(tmp_path / "a", silent).reach()
        with pytest.raises(InputError, match="Axis_1 is in m, its joint in rad"):
            cell(tmp_path / "b", silent, 'position_unit = "mm"\n').reach()
        source = OpcuaRobot(robot="arm", url=silent.url, position_unit="deg")
        with listening(source) as heard:
            wait_for(lambda: any(isinstance(s, JointSample) for s in heard))
        sample = next(s for s in heard if isinstance(s, JointSample))
        assert np.abs(np.array(sample.q) - HOME).max() < 0.51
        assert sample.qd is None


def test_which_robot_and_which_axes_must_be_clear(tmp_path, server):
    with pytest.raises(InputError, match="several robots; the server has: Cell/R1, Cell/R2"):
        cell(tmp_path / "a", server).reach()
    names = ", ".join(f'"J{k}"' for k in range(1, 7))
    with pytest.raises(InputError, match="no axis J1"):
        cell(tmp_path / "b", server, f'device = "R2"\naxes = [{names}]\n').reach()
    cell(tmp_path / "c", server, 'device = "R2"\n').reach()
    with pytest.raises(InputError, match=r"R2 has the axes Axis_1, .*, arm has 7 joints; name one"):
        cell(tmp_path / "d", server, 'device = "R2"\n', robot="iiwa14").reach()


def test_a_server_that_comes_late_with_other_axes_is_not_heard(server, caplog):
    """At its start the run could not ask it; a robot of seven joints is not moved by six axes."""
    names = tuple(f"j{k}" for k in range(7))
    free = (math.inf,) * 7
    low = tuple(-x for x in free)
    target = Target(name="arm", joints=names, units=("rad",) * 7, lower=low, upper=free, velocity=(None,) * 7)
    samples = []
    source = OpcuaRobot(name="arm", robot="arm", url=server.url, device="R1")
    listener = Listener(source, target, samples.append)
    listener.start()
    wait_for(lambda: "arm has 7 joints" in caplog.text)
    listener.ask_to_stop()
    assert listener.join(30)
    assert samples == []


# -- protection ---------------------------------------------------------------------------------


def certificate(folder, name, uri):
    from cryptography import x509
    from cryptography.hazmat.primitives import hashes, serialization
    from cryptography.hazmat.primitives.asymmetric import rsa

    key = rsa.generate_private_key(public_exponent=65537, key_size=2048)
    who = x509.Name([x509.NameAttribute(x509.oid.NameOID.COMMON_NAME, name)])
    now = datetime.datetime.now(datetime.UTC)
    made_of = (
        x509.CertificateBuilder()
        .subject_name(who)
        .issuer_name(who)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - datetime.timedelta(days=1))
        .not_valid_after(now + datetime.timedelta(days=1))
        .add_extension(
            x509.SubjectAlternativeName([x509.UniformResourceIdentifier(uri), x509.DNSName("localhost")]),
            critical=False,
        )
        .sign(key, hashes.SHA256())
    )
    (folder / f"{name}.pem").write_bytes(made_of.public_bytes(serialization.Encoding.PEM))
    (folder / f"{name}.key").write_bytes(
        key.private_bytes(
            serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
        )
    )
    return folder / f"{name}.pem", folder / f"{name}.key"


def test_only_who_is_known_comes_in(tmp_path):
    server_files = certificate(tmp_path, "server", URI)
    own, _ = certificate(tmp_path, "twin", "urn:freeopcua:client")
    certificate(tmp_path, "stranger", "urn:freeopcua:client")
    with OpcuaServer(PLC, certificate=server_files, trusted=(own,)) as server:

        def source(who, **more):
            options = {"security": Security.ENCRYPT, "certificate": f"{who}.pem", "key": f"{who}.key"}
            return Opcua(name="plc", url=server.url, server_certificate="server.pem", **(options | more))

        with listening(source("twin"), target(SPEED, folder=tmp_path)) as heard:
            wait_for(lambda: good(heard))
        said = " ".join(f.text for f in reached(source("stranger"), tmp_path, target()))
        assert "not let in at start" in said
        said = " ".join(f.text for f in reached(Opcua(name="plc", url=server.url), tmp_path, target()))
        assert "not let in at start" in said


def test_what_is_missing_is_named_before_the_start(tmp_path, monkeypatch):
    monkeypatch.delenv("SEEROB_NONE", raising=False)
    bad = Variable(name="bad", source="plc", unit="1", address=5)
    source = Opcua(
        name="plc",
        url="opc.tcp://127.0.0.1:1",
        security=Security.ENCRYPT,
        key="gone.key",
        password_env="SEEROB_NONE",
    )
    with pytest.raises(InputError) as caught:
        source.open(tmp_path, target(bad))
    for part in ("certificate", "gone.key", "SEEROB_NONE", "bad.address"):
        assert part in str(caught.value)


# -- names and units ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("code", "of_the_standard", "spelling"),
    [("DD", 17476, "deg"), ("C81", 4405297, "rad"), ("MMT", 5066068, "mm"), ("MTS", 5067859, "m/s")],
)
def test_unit_ids_are_the_published_numbers(code, of_the_standard, spelling):
    assert number(code) == of_the_standard
    assert unit(of_the_standard) == spelling
    assert spelling in UNITS
    assert unit(4711) == ""


def test_addresses():
    assert address("ns=2;i=5") == "ns=2;i=5"
    assert address({"browse": ["a|b", "c"]}) == Address(("a|b", "c"))
    wrong_ids = "i=-1", "i=1e3", "ns=70000;i=1", "s=", "g=1", "b=é", "nsu=;s=a", "ns=x;s=a", f"i={1 << 32}"
    for wrong in ("Speed", 5, {"path": []}, {"browse": []}, {"browse": [1]}, *wrong_ids):
        with pytest.raises((ValueError, TypeError)):
            address(wrong)


@pytest.mark.parametrize("name", ["a;b", "a;s=b", "ns=3;i=4", '"DB"."x"', "a|b\n", b"\xff;", 7, UUID(int=5)])
@pytest.mark.parametrize("uri", ["urn:a", "http://a/;x=1", ""])
def test_a_node_id_is_read_as_it_is_written_whatever_its_name(uri, name):
    """A semicolon in a name must not lead to another node, which there may be."""
    ua = pytest.importorskip("asyncua").ua
    node_id = ua.NodeId(name, 3)
    found = node_name(written(node_id, uri))
    assert found.uri == uri
    assert found.node_id(3) == node_id
    assert type(found.node_id(3).Identifier) is type(name)
    assert found.node_id(3).NodeIdType == node_id.NodeIdType or isinstance(name, int)


def test_a_name_on_a_path_may_hold_a_bar():
    assert browse_name("urn:a|b|c") == ("urn:a", "b|c")
    assert browse_name("Server") == ("", "Server")


def test_axes_in_natural_order():
    names = [f"Axis_{k}" for k in (10, 2, 1, 9)]
    assert sorted(names, key=natural) == ["Axis_1", "Axis_2", "Axis_9", "Axis_10"]
    assert math.isclose(UNITS["deg"].factor * 180, math.pi)


def test_values_that_are_played_again_are_a_restart_once_and_a_loop_then(monkeypatch):
    """Over a real server whose SourceTimestamp goes back; the hold of a restart ends by itself."""
    monkeypatch.setattr("seerob.devices.variables.live_source.RESTART_HOLD", 0.6)
    played = {
        "Belt/speed": Emulated(lambda t: 100.0 + t % 7.0, "mm/s"),
        "Belt/running": Emulated(lambda t: True),
    }
    server = OpcuaServer(played).start()
    try:
        with listening(Opcua(name="plc", url=server.url), target(SPEED, RUNS)) as heard:
            doubt = lambda: heard[-1].doubts.get("belt/speed", "") if heard else "?"  # noqa: E731
            wait_for(lambda: good(heard))
            server.clock = lambda: time.time() - 2.0
            wait_for(lambda: "it seems to have started again" in doubt())
            wait_for(lambda: good(heard))  # its clock goes on
            count = len(heard)
            wait_for(lambda: len(heard) > count + 20)
            assert good(heard)
            server.clock = lambda: time.time() - 4.0
            wait_for(lambda: "not for the first time within 60 s: a loop?" in doubt())
            time.sleep(1.0)
            assert "a loop?" in doubt()
            assert "a loop?" not in heard[-1].doubts.get("belt/runs", "")  # which never changed
    finally:
        server.stop()


@pytest.mark.parametrize(
    ("back", "doubted"), [(0.05, True), (0.25, True), (0.26, True), (9.9, True), (10.1, False)]
)
def test_a_value_that_is_older_than_one_that_was_heard_is_not_relied_on_until_there_is_a_newer_one(
    back, doubted
):
    """What came late stands for as long as nothing new is said: a door that is shut, and was opened."""
    picture = Picture((RUNS,), by_exception=True)
    picture.take((Change("belt/runs", True, stamp=50.0),), 100.0)
    picture.take((Change("belt/runs", False, stamp=50.0 - back),), 101.0)
    for now in (110.0, 1000.0):
        assert bool(picture.sample(now).doubts) is doubted
    picture.take((Change("belt/runs", False, stamp=49.999),), 1001.0)
    assert bool(picture.sample(1100.0).doubts) is doubted
    picture.take((Change("belt/runs", True, stamp=50.0 if back < 10 else 60.0),), 1101.0)
    assert not picture.sample(1200.0).doubts


def test_a_value_that_was_overtaken_is_of_the_past_that_was_judged_by_another():
    """It shows as what it was said to be last; nothing rests on it until there is news, and a while after."""
    picture = Picture((SPEED,), by_exception=True)
    for stamp, raw in ((9.0, 250.0), (10.0, 250.0), (9.8, 300.0)):
        picture.take((Change("belt/speed", raw, stamp=stamp),), 100.0)
    sample = picture.sample(100.0)
    assert sample.values == {"belt/speed": 0.25}
    assert "came it late" in sample.doubts["belt/speed"]
    picture.take((Change("belt/speed", 260.0, stamp=10.1),), 100.001)
    assert "came it late" in picture.sample(100.5).doubts["belt/speed"]
    assert not picture.sample(100.6).doubts


@pytest.mark.parametrize(("stamp", "raw"), [(10.0, 250.0), (9.9, 260.0), (9.95, 250.0)])
def test_what_was_told_already_and_what_it_was_all_the_time_is_no_news(stamp, raw):
    picture = Picture((SPEED,), by_exception=True)
    for first, told in ((9.7, 250.0), (9.8, 250.0), (9.9, 260.0), (9.93, 250.0), (10.0, 250.0)):
        picture.take((Change("belt/speed", told, stamp=first),), 100.0 + first)
    assert not picture.sample(111.0).doubts
    picture.take((Change("belt/speed", raw, stamp=stamp),), 111.0)
    assert not picture.sample(111.0).doubts
    picture.take((Change("belt/speed", 250.0, stamp=9.91),), 111.0)  # it was 260 then
    assert "came it late" in picture.sample(111.0).doubts["belt/speed"]


def test_what_is_called_bad_counts_whenever_it_was_so():
    picture = Picture((SPEED,), by_exception=True)
    picture.take((Change("belt/speed", 250.0, stamp=10.0),), 100.0)
    picture.take((Change("belt/speed", 1.0, invalid_reason="the server says Bad", stamp=9.8),), 100.0)
    assert "Bad" in picture.sample(100.0).doubts["belt/speed"]
