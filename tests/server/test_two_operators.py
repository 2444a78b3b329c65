"""Two visitors in headsets are two people of the twin: a distance is between them, and they collide.

Both pages speak over real connections; what their sources made of it is then played to the engine tick by
tick, so that no machine is too slow for it.
"""

import time
from contextlib import ExitStack, contextmanager

import msgspec
import mujoco
import numpy as np
import pytest

import seerob as sr
from seerob.app.server.live import Live
from seerob.app.server.serving import Server
from seerob.core.snapshot import Verdict
from seerob.devices.live.listening import Listener
from seerob.session import run as road
from server.frames import MESHES, PATIENCE, scene
from server.test_headset import POINTS, Page

APART, WALK, STEPS, TICKS = 1.6, 0.7, 50, 90
CONTACT = '[[contacts]]\nbetween = ["anna", "bert"]\n'


def cell(more=""):
    text = 'title = "Two operators"\n[engine]\nhuman_tracking_limit = 3\n'
    for name, x, yaw in (("anna", 0.0, 0), ("bert", APART, 180)):
        at = f"at = {{ position = [{x}, 0, 0], rpy_deg = [0, 0, {yaw}] }}\n"
        text += f'[[humans]]\nname = "{name}"\nstature = 1.75\nmass = 75\nsex = "male"\n'
        text += f"unseen_uncertainty_mm = 50\n{at}"
        text += f'[[sources]]\nkind = "headset"\nhuman = "{name}"\ntimeout = 5\nhold = 5\n{at}'
    text += '[[safety]]\nkind = "minimum_distance"\nname = "apart"\nbetween = ["anna", "bert"]\nlimit = 0.5\n'
    return text + more


@contextmanager
def listening(source, samples):
    listener = Listener(source, None, samples.append)
    listener.start()
    try:
        yield
    finally:
        listener.ask_to_stop()
        assert listener.join(PATIENCE)


def steps(ahead):
    """Head and hands of somebody who went so far ahead: y up, -z ahead."""
    return np.array([[0.0, 1.64, 0.0], [-0.25, 1.0, -0.15], [0.25, 1.0, -0.15]]) - [0, 0, ahead]


@pytest.fixture(scope="module", name="told")
def what_sources_say(tmp_path_factory):
    """Samples of each person, who walks ahead step by step."""
    folder = tmp_path_factory.mktemp("two")
    (folder / "workstation.toml").write_text(cell())
    station = sr.load(folder)
    told = {source.human: [] for source in station.workstation.sources}
    with ExitStack() as until_the_end:
        server = until_the_end.enter_context(Server(scene=scene(), meshes=MESHES, feed=Live(), port=0))
        pages = {}
        for source in station.workstation.sources:
            until_the_end.enter_context(listening(source.taking(server.offers), told[source.human]))
            pages[source.human] = until_the_end.enter_context(Page(server))
        end, k = time.monotonic() + PATIENCE, 0
        while min(map(len, told.values())) < STEPS + 1:
            assert time.monotonic() < end, {name: len(samples) for name, samples in told.items()}
            for name, page in pages.items():
                # Each goes on once what it said was heard; the first is said until the source has begun.
                gone = WALK * min(len(told[name]), STEPS) / STEPS
                page.see(k, human=name, names=POINTS, places=steps(gone) + 3e-7 * (k % 3))
            k += 1
            time.sleep(0.01)
    return told


def played(folder, told, more):
    """Per tick: the distance that is judged, the force between both [N], and how far trunks are apart [m]."""
    (folder / "workstation.toml").write_text(cell(more))
    station = sr.load(folder)
    engine = road.engine_of(station.model)
    judge = road.Judge(station.bound, ())

    def feed():
        for tick in range(TICKS):
            t = tick * 0.01
            step = min(tick, STEPS)
            yield tuple(msgspec.structs.replace(samples[step], t=t, seq=tick) for samples in told.values())

    names = [body.name for body in station.model.bodies]
    owner = {body.mj: body.mover for body in station.model.bodies}
    found, force = [], np.zeros(6)
    for snapshot, _ in road.ticks(engine, judge, feed()):
        data, push = engine._data, 0.0
        for k in range(data.ncon):
            pair = {owner.get(int(engine._mj.geom_bodyid[geom])) for geom in data.contact[k].geom}
            if pair == {"anna", "bert"}:
                mujoco.mj_contactForce(engine._mj, data, k, force)
                push += force[0]
        at = dict(zip(names, np.frombuffer(snapshot.poses, "<f4").reshape(-1, 7)[:, :3], strict=True))
        trunks = float(np.linalg.norm(at["anna/thorax"] - at["bert/thorax"]))
        found.append((snapshot.results[0], push, trunks))
    return found


@pytest.fixture(scope="module", name="runs")
def with_and_without_contact(told, tmp_path_factory):
    return [played(tmp_path_factory.mktemp("run"), told, more) for more in (CONTACT, "")]


def test_a_distance_is_between_them_and_falls_while_they_approach(runs):
    found = [result for result, *_ in runs[0]]
    assert {result.name for result in found} == {"apart"}
    values = [result.value for result in found if result.value is not None]
    assert values[0] > 0.5 > values[-1]
    assert found[-1].verdict is not Verdict.WITHIN


def test_where_they_may_touch_they_stop_one_another_and_elsewhere_they_do_not(runs):
    touching, through = runs
    assert max(push for _, push, _ in through) == 0
    assert max(push for _, push, _ in touching) > 10
    assert touching[-1][2] > through[-1][2] + 0.02
