"""Two visitors in headsets are two people of the twin, and where the file says that they touch, they collide.

What their headsets see is scripted, and played to the engine tick by tick.
"""

from collections.abc import Iterator
from types import SimpleNamespace

import numpy as np
import pytest

import seerob as sr
from seerob.core.samples import BodySample
from seerob.core.snapshot import Tracking, Verdict
from seerob.devices.capture.options import observer
from seerob.devices.live.headset_offers import read
from seerob.devices.sources.headset import frame, layout_of
from seerob.session import run as road

APART, WALK, STEPS, TICKS = 1.6, 1.0, 50, 70
JUMPS = 20
POINTS = ("viewer", "left-grip", "right-grip")
STANDS = np.array([[0.0, 1.64, 0.0], [-0.25, 1.0, 0.05], [0.25, 1.0, 0.05]])
DEEPEST = 0.05
"""So far surfaces of bodies that stop one another may be in one another [m]."""


def cell() -> str:
    text = 'title = "Two operators"\n[engine]\nhuman_tracking_limit = 3\n'
    for name, x, yaw in (("anna", 0.0, 0), ("bert", APART, 180)):
        at = f"at = {{ position = [{x}, 0, 0], rpy_deg = [0, 0, {yaw}] }}\n"
        text += f'[[humans]]\nname = "{name}"\nstature = 1.75\nmass = 75\nsex = "male"\n'
        text += f"unseen_uncertainty_mm = 50\n{at}"
        text += f'[[sources]]\nkind = "headset"\nhuman = "{name}"\n{at}'
    text += '[[contacts]]\nbetween = ["anna", "bert"]\n'
    return text + '[[safety]]\nkind = "minimum_distance"\nbetween = ["anna", "bert"]\nlimit = 0.5\n'


def seen_at(ahead: float, aside: float) -> bytes:
    """Poses of head and hands of somebody who went so far [m]."""
    places = STANDS + np.array([aside, 0, -ahead])
    return np.column_stack([places, np.tile([1.0, 0, 0, 0], (3, 1))]).astype("<f4").tobytes()


def walks(station: sr.Station, aside: dict[str, float] | None = None) -> Iterator[list[BodySample]]:
    """Samples of both, who walk toward one another, until each has come farther than the middle.

    From `JUMPS` on somebody is so far ``aside`` [m].
    """
    layout = layout_of(POINTS)
    seen = []
    for source in station.workstation.sources:
        description = station.model.human(source.human).description
        bound, _ = observer(source, layout, description, file="headset")
        seen.append((source.human, bound))
    for tick in range(TICKS):
        ahead = WALK * min(tick, STEPS) / STEPS + 3e-7 * (tick % 3)
        told = []
        for human, bound in seen:
            poses = seen_at(ahead, (aside or {}).get(human, 0.0) * (tick >= JUMPS))
            says = Tracking(human=human, t=0.01 * tick, names=POINTS, poses=poses)
            points = bound.points(frame(read(says, 0.01 * tick), layout))
            told.append(
                BodySample(source=human, target=human, seq=tick, t=0.01 * tick, points=points, hold=1.0)
            )
        yield told


def played(station: sr.Station, *, contacts: bool) -> SimpleNamespace:
    """Least distance [m], largest force between both [N], how far the heads are past one another [m]."""
    engine, judge = road.engine_of(station.model, contacts=contacts), road.Judge(station.bound, ())
    rows = {body.name: row for row, body in enumerate(station.model.bodies)}
    owner = {body.mj: body.mover for body in station.model.bodies}
    found, force = [], 0.0
    for snapshot, _ in road.ticks(engine, judge, walks(station)):
        found.append(snapshot.results[0])
        for one, other, push in engine.state.touches or ():
            assert {owner[one], owner[other]} == {"anna", "bert"}
            force = max(force, push)
    at = np.frombuffer(snapshot.poses, "<f4").reshape(-1, 7)
    least = min(result.value for result in found if result.value is not None)
    past = float(at[rows["anna/head"], 0] - at[rows["bert/head"], 0])
    return SimpleNamespace(verdict=found[-1].verdict, least=least, force=force, past=past)


@pytest.fixture(scope="module", name="station")
def a_twin_of_two(tmp_path_factory: pytest.TempPathFactory) -> sr.Station:
    folder = tmp_path_factory.mktemp("two")
    (folder / "workstation.toml").write_text(cell())
    return sr.load(folder)


def test_people_who_may_touch_stop_one_another_and_others_pass_through(station):
    """Asked is the least distance of both, not that of one bone.

    A head that is stopped turns the body about it, so at the same instant hands, or trunks of who leans, may
    be nearer than those of people who pass through.
    """
    touching, through = played(station, contacts=True), played(station, contacts=False)
    assert touching.verdict is through.verdict is Verdict.EXCEEDED
    assert touching.force > 100
    assert touching.least > -DEEPEST
    assert touching.past < 0
    assert (through.force, through.past > 0.1, through.least < -0.1) == (0.0, True, True)


def test_who_is_5_m_away_within_a_picture_has_no_speed_and_nothing_rests_on_them(station):
    people = {name: station.model.mechanisms[name] for name in ("anna", "bert")}
    moved = {}
    for away in (5.0, 50.0):
        engine, judge = road.engine_of(station.model), road.Judge(station.bound, ())
        doubts: dict[str, list[str]] = {"anna": [], "bert": []}
        moved[away] = []
        for snapshot, _ in road.ticks(engine, judge, walks(station, {"anna": away})):
            for name in people:
                doubts[name].append(engine.state.invalid_source_reason(name))
            if snapshot.seq < JUMPS + 5:
                moved[away].append([engine.state.data.qvel[who.v_address] for who in people.values()])
            if snapshot.seq in range(JUMPS, JUMPS + 5):
                assert snapshot.results[0].verdict is Verdict.UNDECIDED, snapshot.results[0]
                assert "anna" in snapshot.results[0].reason
        assert all("jumped" in doubt or "elsewhere" in doubt for doubt in doubts["anna"][JUMPS : JUMPS + 5])
        assert not any(doubts["bert"])
    near, far = (np.array(speeds) for speeds in moved.values())
    # Nothing of how far the leap is becomes a motion, and nobody gets faster than the walk of 2 m/s was.
    assert np.array_equal(near, far)
    assert np.linalg.norm(near[:, :, :3], axis=2).max() < 1.2 * WALK / (STEPS * 0.01)
