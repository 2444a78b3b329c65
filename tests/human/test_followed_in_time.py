"""How soon the person in the physics is where a headset's wearer is: in the time of samples, tick by tick.

A live run is behind the world by a delay that is fixed (`delay_of`): at run time t it has heard what was seen
until t + delay, and what it shows then is judged against where the wearer is at that instant.
"""

from types import SimpleNamespace

import numpy as np
import pytest

import seerob as sr
from made_cell import VISITOR_AT_TABLE
from seerob.core.errors import Undecided
from seerob.core.samples import BodySample
from seerob.core.snapshot import Tracking
from seerob.core.transforms import rotation_from_wxyz
from seerob.devices.capture.options import observer
from seerob.devices.live.headset_offers import read
from seerob.devices.live.listening import delay_of
from seerob.devices.sources.headset import frame, layout_of
from seerob.protocols.tracking.vive import WORLD_FROM_XR
from seerob.session import run as road
from seerob.twin.accuracy.tracking_error import TrackingError

HZ, TICKS, BEGINS = 72.0, 125, 0.5
POINTS = ("viewer", "left-grip", "right-grip")
BEFORE = np.array([[0, 1.64, 0], [-0.25, 1.1, -0.3], [0.25, 1.1, -0.3]])
BY = np.array([[0.12, -0.04, -0.05], [0, 0, 0], [0.15, -0.1, -0.1]])
"""A step aside, and the right hand further ahead and down besides [m]."""
LASTS = 0.4
STARTS = 1 / 6
"""So long whoever leapt gets faster [s]."""
FOLLOWS, WITHIN = 0.010, 0.100
CELL = (
    VISITOR_AT_TABLE
    + """[[safety]]
kind = "minimum_distance"
between = ["anna", "table"]
"""
)


def reaching(t):
    """Where the wearer is at ``t`` [s], who reaches as smoothly as can be; y up [m], (3, 3)."""
    s = np.clip((t - BEGINS) / LASTS, 0, 1)
    return BEFORE + BY * s**3 * (10 - 15 * s + 6 * s**2)


def leaping(size, speed=0.0):
    """Of whoever is put elsewhere within a picture, to the rear, and goes ahead from there [m, m/s]."""

    def way(t):
        s = max(t - BEGINS, 0.0)
        goes = speed * (s**2 / (2 * STARTS) if s < STARTS else s - STARTS / 2)
        return BEFORE + np.array([0, 0, size * (t >= BEGINS) - goes])

    return way


@pytest.fixture(scope="module", name="station")
def a_twin(tmp_path_factory):
    folder = tmp_path_factory.mktemp("followed")
    (folder / "workstation.toml").write_text(CELL)
    return sr.load(folder)


def played(station, way):
    """Where head and right hand are, (ticks, 2, 3), of which instants of the world, and reasons.

    Asked are the points of both bones that were at the eyes and in the hand before the wearer moved.
    """
    source, layout = station.workstation.sources[0], layout_of(POINTS)
    bound, _ = observer(source, layout, station.model.human("anna").description, file="headset")
    delay, rng = delay_of(station.workstation.sources), np.random.default_rng(1)

    def sample(k):
        places = way(k / HZ) + 4e-4 * (rng.random((3, 3)) - 0.5)  # what is the same to the last bit is frozen
        poses = np.column_stack([places, np.tile([1.0, 0, 0, 0], (3, 1))]).astype("<f4").tobytes()
        says = Tracking(human="anna", t=k / HZ, names=POINTS, poses=poses)
        points = bound.points(frame(read(says, 0.0), layout))
        return BodySample(source="anna", target="anna", seq=k, t=k / HZ, points=points, hold=2.0)

    def feed():
        heard = 0
        for tick in range(TICKS):
            first, heard = heard, int((0.01 * tick + delay) * HZ) + 1
            yield tuple(sample(k) for k in range(first, heard))

    engine, judge = road.engine_of(station.model), road.Judge(station.bound, ())
    rows = {body.name: row for row, body in enumerate(station.model.bodies)}
    bones = [rows["anna/head"], rows["anna/right_hand"]]
    seen = tuple(rows[f"anna/{bone}"] for bone in ("head", "left_hand", "right_hand"))
    error = TrackingError(station.model, bones)
    shown, reasons, offs, speeds = [], set(), [], []
    for snapshot, _ in road.ticks(engine, judge, feed()):
        shown.append(np.frombuffer(snapshot.poses, "<f4").reshape(-1, 7).astype(float)[bones])
        reasons.add(engine.state.invalid_source_reason("anna"))
        try:
            far, speed = error.at(engine.state), engine.state.fastest_speeds(seen, allow_estimated=True).min()
        except Undecided:
            far, speed = np.full(2, np.nan), np.nan
        offs.append(far)
        speeds.append(speed)
    t = 0.01 * np.arange(TICKS) + delay
    at, R = np.array(shown)[..., :3], rotation_from_wxyz(np.array(shown)[..., 3:])
    rests = np.searchsorted(t, BEGINS - 0.05)
    held = np.einsum("nji,nj->ni", R[rests], wearer(way, t[rests]) - at[rests])
    return SimpleNamespace(
        t=t, at=at + np.einsum("tnij,nj->tni", R, held), delay=delay, reasons=reasons - {""},
        error=np.array(offs), speed=np.array(speeds),
    )  # fmt: skip


def wearer(way, t):
    """Eyes and right hand in the cell at an instant, shape (2, 3)."""
    return way(t)[[0, 2]] @ WORLD_FROM_XR.T


def off(found, way, since):
    """Least distance from where the wearer was within the last so many seconds [m], shape (ticks, 2)."""
    ages = np.linspace(0, since, 41)
    past = np.array([[wearer(way, t - age) for age in ages] for t in found.t])
    return np.linalg.norm(found.at[:, None] - past, axis=-1).min(1)


def test_head_and_hand_are_where_the_wearer_was_less_than_a_tenth_of_a_second_ago(station):
    found = played(station, reaching)
    seen = found.t > BEGINS - 0.05
    assert not found.reasons
    assert found.delay < 0.03
    # Of the last tenth of a second as was asked for, and of the last twentieth, as is.
    assert off(found, reaching, WITHIN)[seen].max() < FOLLOWS
    assert off(found, reaching, WITHIN / 2)[seen].max() < FOLLOWS / 2
    assert off(found, reaching, 0.0)[found.t > BEGINS + LASTS].max() < FOLLOWS


def test_who_leaps_is_undecided_until_the_twin_is_there_and_no_slower_than_seen(station):
    """On its way a twin is where nobody is, and as fast as nobody is: that is UNDECIDED, or in the bound."""
    way = leaping(0.15, speed=3.0)
    found = played(station, way)
    decided, after = np.isfinite(found.speed), found.t > BEGINS
    assert any("faster than a person can" in reason for reason in found.reasons)
    away = np.linalg.norm(found.at - [wearer(way, t) for t in found.t - found.delay], axis=-1)
    assert away[after & ~decided].max() > 0.1
    known = decided & (found.t > BEGINS + STARTS + found.delay)
    assert known.any()
    assert (away[known] <= found.error[known] + FOLLOWS / 5).all()
    assert found.speed[known].min() > 3.0 - 0.1
