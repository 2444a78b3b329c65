"""Sources that lie: whatever a class yields, the shipped ones' and one's own, nothing rests on it."""

from __future__ import annotations

import math
from functools import partial

import openpyxl
import pytest
from msgspec.structs import replace

from made_cell import FLOATING, TWO_R, made, person, two_r
from motion_io import made_pictures, made_recordings
from seerob.core.errors import SeerobError
from seerob.core.plugin import kinds, load
from seerob.core.samples import JointSample
from seerob.devices.live.listening import LiveSource
from seerob.session.station import Station
from seerob.testing import sources_never_within
from seerob.workstation.source import Opened, Source

DURATION, PERIOD, LIES_AT = 1.2, 0.01, 40
SPEED = (
    '[[safety]]\nkind = "velocity"\nname = "speed"\nof = "{}"\nlimit = 5\nbetween_samples = "accepted: x"\n'
)


def arm(t: float) -> tuple[float, float]:
    return 0.3 + 0.05 * math.sin(5 * t), 0.5 - 0.1 * math.sin(5 * t)


# -- kinds that ship ------------------------------------------------------------------------------


def table(folder):
    rows = [f"{k * PERIOD:.2f},{arm(k * PERIOD)[0]:.9f},{arm(k * PERIOD)[1]:.9f}\n" for k in range(121)]
    (folder / "m.csv").write_text("time [s],j1 [rad],j2 [rad]\n" + "".join(rows))


def keys(folder):
    text = '[[keyframes]]\nt = {}\nposture = "standing"\njoints_deg = {{ right_shoulder_flexion = {} }}\n'
    (folder / "k.toml").write_text('title = "k"\n' + text.format(0.0, 5) + text.format(DURATION, 20))


def signals(folder):
    rows = "".join(f"{k * 0.05:.2f},{k}\n" for k in range(25))
    (folder / "s.csv").write_text("t,x\n" + rows)
    (folder / "v.toml").write_text(
        '[[variables]]\nname = "level"\nsource = "plc"\naddress = "x"\ntype = "number"\nunit = "1"\n'
    )


def pictures(folder):
    seen = made_pictures.pictures(round(0.6 * made_pictures.RATE))
    (folder / "p.json").write_text(made_pictures.offline_json(seen))


def angles(folder):
    rows = "".join(f"{k * 0.02:.2f},{5 + 10 * k * 0.02:.3f}\n" for k in range(round(DURATION / 0.02) + 1))
    (folder / "a.csv").write_text("time [s],right_shoulder_flexion [deg]\n" + rows)


def rows():
    """Instant and joints [s, rad], from the recording's own start on."""
    return [(k * PERIOD, *arm(k * PERIOD)) for k in range(121)]


def spreadsheet(folder):
    book = openpyxl.Workbook()
    for row in (("time [s]", "j1 [rad]", "j2 [rad]"), *rows()):
        book.active.append(row)
    book.save(folder / "m.xlsx")


def stations(folder):
    """As RoboDK saves a program."""
    head = "J1,J2,ERROR,MM_STEP,DEG_STEP,MOVE_ID,TIME,X,Y,Z\n"
    lines = [f"{math.degrees(a)!r},{math.degrees(b)!r},0,1,1,1,{t:.2f},500,0,0\n" for t, a, b in rows()]
    (folder / "m.csv").write_text(head + "".join(lines))


def recorder(folder):
    """As a KUKA controller's data recorder writes it."""
    head = "% ZeitInSec ZeitInNanoSec axisQMsr_LBR[0] axisQMsr_LBR[1]\n"
    lines = [f"{int(t)} {round(t % 1 * 1e9)} {math.degrees(a)!r} {math.degrees(b)!r}\n" for t, a, b in rows()]
    (folder / "m.log").write_text(head + "".join(lines))


def controller(folder):
    """As UR's ``record.py`` writes it."""
    lines = [f"{4000 + t:.2f} {a!r} {b!r}\n" for t, a, b in rows()]
    (folder / "m.csv").write_text("timestamp actual_q_0 actual_q_1\n" + "".join(lines))


def reach(record):
    """A file of somebody who reaches, of half a second more than a person's time-out takes."""
    return lambda folder: record(folder, made_recordings.reaching(45))


ARM = FLOATING + TWO_R + SPEED.format("arm")
STILL = "[engine]\nphysics = false\n"
MAN = STILL + person("op", 3, 0, 0) + SPEED.format("op")
LEVEL = '[[safety]]\nkind = "variable"\nvariable = "level"\nunit = "1"\nlimit = 99\n'
CELLS = {
    "csv": (table, ARM + '[[sources]]\nkind = "csv"\nrobot = "arm"\nfile = "m.csv"\n'),
    "keyframes": (keys, MAN + '[[sources]]\nkind = "keyframes"\nhuman = "op"\nfile = "k.toml"\n'),
    "kinect_recording": (
        pictures,
        STILL + person("op") + SPEED.format("op") + '[[sources]]\nkind = "kinect_recording"\nhuman = "op"\n'
        'file = "p.json"\nat = { position = [0, 0, 1], rpy_deg = [0, 0, 0] }\n',
    ),
    "joint_angles": (
        angles,
        MAN + '[[sources]]\nkind = "joint_angles"\nhuman = "op"\nfile = "a.csv"\nstays = true\n'
        "rest_at_zero = true\n",
    ),
    "waypoints": (
        lambda folder: (folder / "w.toml").write_text(
            "[[waypoints]]\nq_deg = [10, 20]\n[[waypoints]]\nq_deg = [30, 5]\npause = 0.8\n"
        ),
        ARM + '[[sources]]\nkind = "waypoints"\nrobot = "arm"\nfile = "w.toml"\n'
        "joint_speed = 0.5\njoint_acceleration = 2\njoint_jerk = 50\n",
    ),
    "excel": (spreadsheet, ARM + '[[sources]]\nkind = "excel"\nrobot = "arm"\nfile = "m.xlsx"\n'),
    "robodk": (stations, ARM + '[[sources]]\nkind = "robodk"\nrobot = "arm"\nfile = "m.csv"\n'),
    "kuka_log": (recorder, ARM + '[[sources]]\nkind = "kuka_log"\nrobot = "arm"\nfile = "m.log"\n'),
    "ur_record": (controller, ARM + '[[sources]]\nkind = "ur_record"\nrobot = "arm"\nfile = "m.csv"\n'),
    "c3d": (
        reach(partial(made_recordings.c3d, markers=[*made_recordings.MARKERS, "RFIN", "LFIN"])),
        STILL
        + person("op")
        + SPEED.format("op")
        + '[[sources]]\nkind = "c3d"\nhuman = "op"\nfile = "r.c3d"\n',
    ),
    "bvh": (
        reach(made_recordings.bvh),
        STILL
        + person("op")
        + SPEED.format("op")
        + '[[sources]]\nkind = "bvh"\nhuman = "op"\nfile = "r.bvh"\n',
    ),
    "signals_csv": (
        signals,
        'variables = "v.toml"\n'
        + ARM.replace(SPEED.format("arm"), "")
        + LEVEL
        + '[[sources]]\nkind = "signals_csv"\nname = "plc"\nfile = "s.csv"\ntime = "t"\ntime_unit = "s"\n',
    ),
}


LEFT_OUT = {
    "recording": "says what another source said, in this format; a lie in it is that source's",
    "tool_path": "says poses of a tool; `tests/sources/test_tool_path.py` has its own",
}


def test_every_kind_of_source_is_played_or_says_its_samples_by_the_road_of_one_that_is():
    """Live ones are looked at where they are heard: `tests/live/test_lying_streams.py`."""
    roads = {load("sources", kind, Source).__mro__[1] for kind in CELLS} - {Source}
    for kind in set(kinds("sources")) - set(CELLS) - set(LEFT_OUT):
        found = load("sources", kind, Source)
        assert issubclass(found, (LiveSource, *roads)), kind


@pytest.mark.parametrize("kind", CELLS)
def test_nothing_rests_on_a_source_that_lies(tmp_path, kind):
    write, text = CELLS[kind]
    write(tmp_path)
    sources_never_within(made(tmp_path, text, {"arm.urdf": two_r()}))


# -- one's own ------------------------------------------------------------------------------------


class Own(Source, frozen=True, kw_only=True):
    """Says where an arm is, and from an instant on something else."""

    lie: object = None

    def target(self):
        return "arm"

    def open(self, folder, target):
        def every():
            for k in range(round(DURATION / PERIOD)):
                sample = said(k) if k < LIES_AT else self.lie(k, said(k))
                if sample is not None:
                    yield sample

        return Opened(samples=Again(every), duration=DURATION - PERIOD)


class Again:
    def __init__(self, begin):
        self._begin = begin

    def __iter__(self):
        return self._begin()


def said(k):
    """What an honest one says."""
    t = k * PERIOD
    qd = 0.25 * math.cos(5 * t), -0.5 * math.cos(5 * t)
    return JointSample(source="own", seq=k, t=t, target="arm", q=arm(t), qd=qd)


def fails(k, sample):
    raise ZeroDivisionError("one's own")


NAN = math.nan
OWN = {
    "a joint that is no number": lambda k, s: replace(s, q=(s.q[0], NAN)),
    "speeds that are no numbers": lambda k, s: replace(s, qd=(NAN, NAN)),
    "swapped joints": lambda k, s: replace(s, q=s.q[::-1], qd=s.qd[::-1]),
    "positions that stand while speeds do not": lambda k, s: replace(s, q=arm(LIES_AT * PERIOD)),
    "speeds that stand while positions do not": lambda k, s: replace(s, qd=(0.0, 0.0)),
    "speeds of the wrong sign": lambda k, s: replace(s, qd=(-s.qd[0], -s.qd[1])),
    "one instant ahead of its time": lambda k, s: replace(s, t=s.t + 0.15) if k == LIES_AT else s,
    "a slow clock": lambda k, s: replace(s, t=LIES_AT * PERIOD + 0.2 * (s.t - LIES_AT * PERIOD)),
    "two arms in turn": lambda k, s: replace(s, q=(s.q[0] + 0.2 * (k % 2), s.q[1])),
    "another robot": lambda k, s: replace(s, target="nobody"),
    "one joint too few": lambda k, s: replace(s, q=s.q[:1]),
    "a text": lambda k, s: replace(s, q=("a", "b")),
    "no sample": lambda k, s: "sample",
    "a quality of its own": lambda k, s: replace(s, quality="fine"),
    "its last sample with new times": lambda k, s: replace(said(LIES_AT - 1), t=s.t, seq=s.seq),
    "its last third of a second again and again": lambda k, s: replace(
        said(LIES_AT - 30 + (k - LIES_AT) % 30), t=s.t, seq=s.seq
    ),
    "no gap where it heard nothing": lambda k, s: replace(said(k + 30), t=s.t, seq=s.seq),
    "nought where it has no number": lambda k, s: replace(s, q=(0.0, 0.0), qd=(0.0, 0.0)),
    "what a joint was last where it has no number": lambda k, s: replace(s, q=(s.q[0], said(LIES_AT).q[1])),
    "speeds in degrees": lambda k, s: replace(s, qd=(math.degrees(s.qd[0]), math.degrees(s.qd[1]))),
    "half its motion in all its time": lambda k, s: replace(s, t=0.5 * (s.t + LIES_AT * PERIOD)),
    "every other sample of before": lambda k, s: said(LIES_AT - 1) if k % 2 else s,
    "new times of a clock that stands": lambda k, s: replace(said(LIES_AT), t=s.t, t_device=LIES_AT * PERIOD),
    "an error": fails,
    "nothing": lambda k, s: None,
}  # fmt: skip
SETTLED = 0.3
"""By when a contradiction of positions and speeds shows [s]."""


class Kept:
    """The verdicts of a run, by instant."""

    def __init__(self):
        self.told = []

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass

    def write(self, snapshot, samples):
        self.told += [(snapshot.t, result.verdict) for result in snapshot.results]


@pytest.fixture(scope="module")
def cell(tmp_path_factory):
    return made(tmp_path_factory.mktemp("own"), ARM.replace("physics = false\n", ""), {"arm.urdf": two_r()})


def played(cell, lie):
    """Verdicts of a run in which one's own source lies, and what ended it."""
    station, kept = Station(replace(cell.workstation, sources=(Own(name="own", lie=lie),))), Kept()
    try:
        station.run(writers=[kept])
    except SeerobError as error:
        return kept.told, str(error)
    return kept.told, ""


def test_a_source_of_ones_own_that_does_not_lie_is_within(cell):
    told, ended = played(cell, lambda k, sample: sample)
    assert ({verdict for _, verdict in told}, ended) == ({"within"}, "")
    assert told[-1][0] == pytest.approx(DURATION - PERIOD)


@pytest.mark.parametrize("what", OWN)
def test_nothing_rests_on_a_source_of_ones_own_that_yields(cell, what):
    told, ended = played(cell, OWN[what])
    late = [verdict for t, verdict in told if t > LIES_AT * PERIOD + SETTLED]
    assert "within" not in late
    # Either the run ends with a message that names the source, or goes on undecided.
    assert ("undecided" in late) != ("own" in ended or "nobody" in ended)


def test_a_source_of_ones_own_returns_what_a_source_returns(cell):
    for returned, words in (
        (None, "open returns NoneType"),
        (Opened(samples=(), duration=NAN), "duration is nan"),
    ):

        class Odd(Own, frozen=True, kw_only=True):
            def open(self, folder, target, returned=returned):
                return returned

        station = Station(replace(cell.workstation, sources=(Odd(name="own"),)))
        with pytest.raises(SeerobError, match=words):
            station.run()


def test_a_source_of_ones_own_that_cannot_be_opened_is_told_with_file_and_key(cell):
    class Odd(Own, frozen=True, kw_only=True):
        def open(self, model):
            return model

    station = Station(replace(cell.workstation, sources=(Odd(name="own"),)))
    with pytest.raises(
        SeerobError, match=r"workstation\.toml: sources\[0\]: open of .* fails: TypeError: .*open\("
    ):
        station.run()
