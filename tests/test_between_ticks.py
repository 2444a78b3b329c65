"""Between two ticks: what passes through something there is exceeded, and no bound is ever beaten."""

from __future__ import annotations

from dataclasses import replace

import msgspec
import numpy as np
import pytest
from msgspec.structs import replace as sample_with

from made_cell import TWO_R, UR10, heard, made, person, two_r
from made_ticks import DOOR, PLC, SOURCE, rows
from seerob.core.markers import plain
from seerob.core.samples import Quality
from seerob.core.snapshot import Finding, Verdict
from seerob.criteria.between_ticks import SpanResult
from seerob.criteria.contact.regions import REGIONS
from seerob.criteria.safety.power_and_force import Contacts
from seerob.description.humans.skeleton import BONES
from seerob.session.run import Judge, bind, engine_of, pump, ticks
from seerob.twin.engine import Engine
from seerob.twin.state import State
from worst_between import one_by_one, worst_found

msgpack = msgspec.msgpack.Encoder(enc_hook=plain).encode

STICK = (
    '[[tools]]\nname = "stick"\non = "arm/tip"\nmass = 0.01\nuniform_density = true\n'
    "shape = { box = [0.1, 0.004, 0.004] }\nat = { position = [0.05, 0, 0] }\n"
)
POST = (
    '[[parts]]\nname = "post"\nshape = {{ box = [0.004, 0.004, 0.5] }}\nat = {{ position = [{x}, {y}, 0] }}\n'
)
AREA = (
    '[[areas]]\nname = "zone"\nshape = {{ box = [0.01, 0.004, 0.4] }}\nat = {{ position = [{x}, {y}, 0] }}\n'
)
CURTAIN = (
    '[[sensors]]\nname = "curtain"\nresponse = 0.02\ncapability = 0.014\nsource = "data sheet"\n'
    "at = {{ position = [{x}, {y}, -0.3] }}\n"
    "light_curtain = {{ ends = [[-0.005, 0, 0], [0.005, 0, 0]], height = 0.6, pitch = 0.002 }}\n"
)


def swing(speed):
    """Both links in line, turning at a speed [rad/s]."""
    return lambda t: ((speed * t, 0.0), (speed, 0.0))


def passing(
    folder, criterion, thing, *, physics="true", tick=0.01, at=0.195, rate=125, speed=1.45, told=None, arm=""
):
    """A tool that passes a thing at 3 m/s at an instant between two ticks."""
    angle = speed * at
    placed = thing.format(x=2.08 * np.cos(angle), y=2.08 * np.sin(angle))
    engine = f"engine = {{ gravity = [0, 0, 0], physics = {physics}, tick = {tick} }}\n"
    times = np.arange(0, 0.4 + 1e-9, 1 / rate).tolist()
    files = {"arm.urdf": two_r(), "motion.csv": rows(swing(speed), times)}
    if told is not None:
        engine, criterion = f'variables = "v.toml"\n{engine}', f'{criterion}active = "door"\n{PLC}'
        files |= {"v.toml": DOOR, "s.csv": "t,x\n" + "".join(f"{t},{x}\n" for t, x in told)}
    return made(folder, engine + TWO_R + arm + STICK + placed + SOURCE + criterion, files)


THROUGH = {
    "post": (
        POST,
        '[[safety]]\nkind = "minimum_distance"\nname = "c"\nbetween = ["stick", "post"]\nlimit = 0.005\n',
    ),
    "area": (AREA, '[[safety]]\nkind = "safety_area"\nname = "c"\narea = "zone"\nof = "stick"\n'),
    "curtain": (
        CURTAIN,
        '[[safety]]\nkind = "light_curtain"\nname = "c"\nsensor = "curtain"\nof = "stick"\n',
    ),
}


def test_who_has_no_limit_is_not_bounded_between_ticks(tmp_path, monkeypatch):
    """Nothing that it says could be lost there, by its period or by a field of a sensor something could."""
    told = '[[safety]]\nkind = "velocity"\nname = "v"\nof = "arm"\n'
    distance = THROUGH["post"][1].replace("limit = 0.005\n", "")
    for more, criterion in enumerate([*(c for _, c in THROUGH.values()), f"{told}every = 0.1\n"]):
        thing = THROUGH["curtain"][0] if "curtain" in criterion else AREA + POST
        (one,) = passing(tmp_path / str(more), criterion, thing).bound
        assert not one.watch.informs
    station = passing(tmp_path / "informs", told + distance, POST)
    assert all(one.watch.informs for one in station.bound)
    monkeypatch.setattr(State, "largest_speeds", lambda state: 1 / 0)
    said = station.run().results
    assert [(said[name].verdict, said[name].max() > 0) for name in "vc"] == [(None, True)] * 2


@pytest.mark.parametrize("physics", ["true", "false"])
@pytest.mark.parametrize("what", THROUGH)
def test_what_is_passed_between_two_ticks_is_exceeded(tmp_path, what, physics):
    thing, criterion = THROUGH[what]
    station = passing(tmp_path, criterion, thing, physics=physics)
    summary = station.run()
    assert summary.results["c"].verdict is Verdict.EXCEEDED
    assert summary.verdict is Verdict.EXCEEDED


@pytest.mark.parametrize(
    ("told", "verdict"),
    [
        ([(0, 0), (0.191, 1), (0.3, 1)], Verdict.EXCEEDED),
        ([(0, 0), (0.1949, 1), (0.3, 1)], Verdict.EXCEEDED),
        ([(0, 1), (0.1985, 0), (0.3, 0)], Verdict.EXCEEDED),
        ([(0, 1), (0.1, 0), (0.192, 1), (0.198, 0), (0.3, 0)], Verdict.EXCEEDED),
        ([(0, 1), (0.1906, 0), (0.194, 1), (0.3, 1)], Verdict.EXCEEDED),  # in the second part of a tick
        ([(0, 0), (0.1985, 1), (0.3, 1)], Verdict.WITHIN),
        ([(0, 1), (0.1915, 0), (0.3, 0)], Verdict.WITHIN),
        ([(0, 1), (0.1915, 0), (0.1985, 1), (0.3, 1)], Verdict.WITHIN),
        ([(0, 1), (0.1902, 2), (0.1988, 1), (0.3, 1)], Verdict.UNDECIDED),  # neither true nor false
    ],
)
@pytest.mark.parametrize("every", ["", "every = 1.0\n"])
def test_what_is_passed_just_when_a_criterion_begins_or_ceases_to_apply_is_judged(
    tmp_path, told, verdict, every
):
    for what in ("post", "area") if not every else ("post",):
        thing, criterion = THROUGH[what]
        station = passing(tmp_path / what, criterion + every, thing, physics="false", told=told)
        assert station.run().results["c"].verdict is verdict, what


def test_what_remembers_is_undecided_where_it_begins_to_apply_between_two_ticks(tmp_path):
    text = person("op", 9, 0, 0) + '[[safety]]\nkind = "separation"\nname = "c"\nmode = "fixed"\n'
    text += 'between = ["arm", "op"]\nstop = { reaction = 0.1, stopping = 0.2, acceleration = 0 }\n'
    text += "intrusion = 0\nhuman_uncertainty = 0\nrobot_uncertainty = 0\n"
    told = [(0, 0), (0.195, 1), (0.3, 1)]
    found = passing(tmp_path, text, POST, physics="false", told=told).run().results["c"]
    assert found.verdict is Verdict.UNDECIDED
    assert "door switched between two ticks" in found.worst().reason


def test_what_a_finding_holds_is_exceeded_between_two_ticks_all_the_same(tmp_path):
    station = passing(tmp_path, THROUGH["post"][1], POST)
    judge = Judge(station.bound, [Finding(level="warning", subject="c", text="another log", holds=("c",))])
    feed = pump(station.sources, station.workstation.engine.tick)
    found = [out.results[0].verdict for out, _ in ticks(engine_of(station.model), judge, feed)]
    assert found.count(Verdict.EXCEEDED) == 1
    assert Verdict.WITHIN not in found


UNBOUNDED = '[[safety]]\nkind = "effective_mass"\nname = "c"\nat = "arm"\ntoward = "post"\nlimit = 90\n'


@pytest.mark.parametrize("accepted", ["", 'between_samples = "accepted: it changes slowly"\n'])
def test_a_run_of_which_nothing_is_known_between_ticks_is_within_only_where_the_file_accepts_that(
    tmp_path, accepted
):
    station = passing(tmp_path, UNBOUNDED + accepted, POST, arm="mass_tolerance = 0.01\n")
    summary = station.run()
    assert set(summary.results["c"].verdicts.tolist()) == {0}  # every tick is within
    assert summary.verdict is (Verdict.WITHIN if accepted else Verdict.UNDECIDED)
    (info,) = summary.scene.criteria
    assert info.between.startswith("accepted: it" if accepted else "nothing bounds it between")
    assert ("between_samples" in summary.results["c"].worst().reason) is not bool(accepted)


@pytest.mark.parametrize("every", [0.05, 4.0])
@pytest.mark.parametrize("what", THROUGH)
def test_what_is_passed_between_two_periods_is_exceeded(tmp_path, what, every):
    thing, criterion = THROUGH[what]
    station = passing(tmp_path, f"{criterion}every = {every}\n", thing)
    assert station.run().results["c"].verdict is Verdict.EXCEEDED


def test_a_period_is_covered_without_being_asked_while_nothing_comes_near(tmp_path):
    criterion = THROUGH["post"][1].replace("0.005", "0.01") + "every = 0.2\n"
    station = passing(tmp_path, criterion, POST.replace("{x}", "5"), speed=0.5)
    summary = station.run()
    assert summary.verdict is Verdict.WITHIN
    assert len(summary.results["c"]) == 3


@pytest.mark.parametrize("every", ["", "every = 1.0\n"])
def test_a_period_hides_no_tick_at_which_devices_know_less_of_a_person(tmp_path, every):
    box = '[[parts]]\nname = "box"\nshape = { box = [0.2, 0.2, 2] }\nat = { position = [1, 0, 1] }\n'
    near = '[[safety]]\nkind = "minimum_distance"\nname = "d"\nbetween = ["op", "box"]\nlimit = 0.5\n'
    station = made(tmp_path, "engine = { physics = false }\n" + person() + box + near + every)
    home = station.model.mechanisms["op"].home
    engine, judge = Engine(station.model, driven={"op": 0.2}), Judge(station.bound)
    verdicts = []
    for k in range(10):
        engine.take([heard("op", 0.01 * k, home, np.zeros(len(home)))])
        state = engine.tick() if k else engine.start()
        state.hearings["op"].bones = dict.fromkeys(BONES, (0.4 if 3 < k < 6 else 0.001, 0.0))
        verdicts.append(judge(state)[0].verdict)
    assert [k for k, verdict in enumerate(verdicts) if verdict is Verdict.UNDECIDED] == [4, 5]


def test_a_bound_of_ones_own_that_fails_leaves_it_undecided_and_the_run_goes_on(tmp_path):
    station = passing(tmp_path, THROUGH["post"][1], POST.replace("{x}", "5"))

    def failing(span, least):
        raise ZeroDivisionError("division by zero")

    (bound,) = station.bound
    judge = Judge([replace(bound, watch=replace(bound.watch, falls=failing))])
    feed = pump(station.sources, station.workstation.engine.tick)
    results = [out.results[0] for out, _ in ticks(engine_of(station.model), judge, feed)]
    assert {result.verdict for result in results[1:]} == {Verdict.UNDECIDED}
    assert all("failed: ZeroDivisionError: division by zero" in result.reason for result in results[1:])


# -- no bound is ever beaten --------------------------------------------------------------------


def random_robot(rng, slides):
    """A chain of joints that turn and slide about any axes, with boxes and masses anywhere."""
    parts, links = [], ['<link name="base"/>']
    for k, slides_here in enumerate(slides):
        mass = rng.uniform(0.5, 4)
        x, size, axis = rng.normal(size=3) * 0.15, rng.uniform(0.05, 0.3, 3), rng.normal(size=3)
        kind = "prismatic" if slides_here else "revolute"
        links.append(
            f'<link name="l{k}"><inertial><origin xyz="{x[0]} {x[1]} {x[2]}"/><mass value="{mass}"/>'
            '<inertia ixx="0.02" iyy="0.03" izz="0.04" ixy="0" ixz="0" iyz="0"/></inertial><collision>'
            f'<origin xyz="{x[0]} {x[1]} {x[2]}"/><geometry>'
            f'<box size="{size[0]} {size[1]} {size[2]}"/></geometry>'
            "</collision></link>"
        )
        at, parent = rng.normal(size=3) * 0.25, f"l{k - 1}" if k else "base"
        parts.append(
            f'<joint name="j{k}" type="{kind}"><parent link="{parent}"/><child link="l{k}"/>'
            f'<origin xyz="{at[0]} {at[1]} {at[2]}" rpy="{rng.normal()} {rng.normal()} {rng.normal()}"/>'
            f'<axis xyz="{axis[0]} {axis[1]} {axis[2]}"/>'
            '<limit lower="-9" upper="9" effort="1e5" velocity="60"/></joint>'
        )
    return f'<robot name="chain">{"".join(links + parts)}</robot>'


def random_wave(rng, joints):
    amplitude, pace, phase = (
        rng.normal(size=joints) * 0.3,
        rng.uniform(1, 9, joints),
        rng.uniform(0, 6, joints),
    )

    def wave(t):
        return amplitude * np.sin(pace * t + phase), amplitude * pace * np.cos(pace * t + phase)

    return wave


RANDOM = """
[engine]
gravity = [0, 0, 0]
tick = {tick}
timestep = 0.001
physics = {physics}
[[robots]]
name = "a"
model = "a.urdf"
[[robots]]
name = "b"
model = "b.urdf"
base = {{ position = [2.5, 0, 0] }}
[[humans]]
name = "op"
stature = 1.75
mass = 75
sex = "male"
at = {{ position = [0, 3, 0] }}
[[areas]]
name = "zone"
shape = {{ box = [1, 1, 1] }}
at = {{ position = [0, -3, 0] }}
[[sources]]
kind = "csv"
robot = "a"
file = "a.csv"
[[sources]]
kind = "csv"
robot = "b"
file = "b.csv"
[[safety]]
kind = "minimum_distance"
name = "distance"
between = ["a", "b"]
limit = 0
[[safety]]
kind = "safety_area"
name = "area"
area = "zone"
of = ["a", "b"]
[[safety]]
kind = "velocity"
name = "fastest"
of = "a"
limit = 10
[[safety]]
kind = "velocity"
name = "point"
at = "a"
offset = [0.1, 0.2, 0.3]
limit = 10
[[safety]]
kind = "kinetic_energy"
name = "energy"
robot = "a"
limit = 2000
[[safety]]
kind = "manipulability"
name = "singularity"
at = "a"
limit = 0
[[safety]]
kind = "separation"
name = "bound"
between = ["a", "op"]
stop = {{ reaction = 0.1, stopping = 0.2 }}
intrusion = 0
human_uncertainty = 0
robot_uncertainty = 0
[[safety]]
kind = "separation"
name = "braking"
between = ["a", "op"]
stop = {{ model = "constant_deceleration", reaction = 0.1, deceleration = 12 }}
human_speed = 1.6
intrusion = 0
human_uncertainty = 0
robot_uncertainty = 0
[[safety]]
kind = "separation_area"
name = "around"
separation = "bound"
of = "op"
[[safety]]
kind = "separation"
name = "ever"
mode = "fixed"
between = ["a", "op"]
stop = {{ reaction = 0.1, stopping = 0.2 }}
intrusion = 0
human_uncertainty = 0
robot_uncertainty = 0
[[safety]]
kind = "separation"
name = "ever held"
mode = "fixed"
between = ["a", "op"]
stop = {{ model = "constant_deceleration", reaction = 0.1, deceleration = 12, acceleration = 2 }}
intrusion = 0
human_uncertainty = 0
robot_uncertainty = 0
[[safety]]
kind = "separation_area"
name = "around it"
separation = "ever"
of = "op"
"""


def random_cell(folder, rng, *, tick, physics, rate, text=RANDOM, scale=1.0, seconds=0.2):
    files = {}
    for name in "ab":
        joints = int(rng.integers(2, 6))
        wave = random_wave(rng, joints)
        slides = rng.random(joints) < 0.3
        units = ("m" if slide else "rad" for slide in slides)
        lines = [",".join(["t [s]", *(f"j{k} [{unit}]" for k, unit in enumerate(units))])]
        for t in np.arange(0, seconds, 1 / rate):
            lines.append(",".join(f"{x:.12g}" for x in (t, *(scale * wave(t)[0]))))
        files |= {f"{name}.urdf": random_robot(rng, slides), f"{name}.csv": "\n".join(lines) + "\n"}
    return made(folder, text.format(tick=tick, physics=physics), files)


CASES = [(1, 0.01, "true", 125), (2, 0.01, "false", 250), (3, 0.005, "true", 40), (4, 0.01, "false", 60)]


@pytest.mark.parametrize(("seed", "tick", "physics", "rate"), CASES)
def test_nothing_that_is_met_between_two_ticks_is_worse_than_the_bound(tmp_path, seed, tick, physics, rate):
    station = random_cell(tmp_path, np.random.default_rng(seed), tick=tick, physics=physics, rate=rate)
    room = worst_found(station, looks=9)
    assert set(room) >= {"distance", "area", "fastest", "point", "energy", "bound", "braking"}
    assert set(room) >= {"ever", "ever held", "around it"}
    # The first arm's last joint moves its point nowhere: it is on its limit of 0, which is exceeded.
    assert ("singularity" in room) is (seed != 1)
    for name, found in room.items():
        assert min(found) >= -1e-9, name


def spoiled_feed(station, rng):
    """The samples of a motion, of which some are missing, in doubt or elsewhere for a while."""
    silent = dict.fromkeys("ab", 0)
    for samples in pump(station.sources, station.workstation.engine.tick):
        heard = []
        for sample in samples:
            draw, name = rng.random(), sample.target
            silent[name] = 60 if draw < 0.01 else max(silent[name] - 1, 0)
            if silent[name]:
                continue
            quality = Quality.DEGRADED if draw > 0.98 else Quality.GOOD
            off = 3.0 if 0.95 < draw < 0.96 else 0.0
            heard.append(sample_with(sample, quality=quality, q=tuple(x + off for x in sample.q)))
        yield tuple(heard)


@pytest.mark.parametrize(("seed", "tick", "physics", "rate"), CASES)
def test_what_is_done_with_all_at_once_comes_to_what_each_by_itself_does(tmp_path, seed, tick, physics, rate):
    text = RANDOM.replace("limit = 10\n", "limit = 1.2\n").replace("limit = 2000", "limit = 20")
    text = text.replace("limit = 0\n", "limit = 0.05\n")
    cell = {"tick": tick, "physics": physics, "rate": rate, "text": text, "scale": 0.5, "seconds": 0.6}
    station = random_cell(tmp_path, np.random.default_rng(seed), **cell)
    together, alone = Judge(bind(station.model)), Judge(bind(station.model))
    assert len(together._between._plain) == 5
    one_by_one(alone)
    said = set()

    def both(state):
        results = together(state)
        assert msgpack(results) == msgpack(alone(state))
        said.update((result.name, result.verdict) for result in results)
        return results

    feed = spoiled_feed(station, np.random.default_rng(seed))
    for _ in ticks(engine_of(station.model), both, feed):
        pass
    assert together.looks == alone.looks > 0
    verdicts = {verdict for _, verdict in said}
    assert verdicts >= {Verdict.WITHIN, Verdict.EXCEEDED, Verdict.UNDECIDED}


NOT_HEAD = ["Skull and forehead", "Face", "Larynx, eyes and ears", "Feet"]
CONTACT = """
[[parts]]
name = "table"
shape = {{ box = [0.6, 0.6, 0.3] }}
at = {{ position = [{x}, {y}, -0.1] }}
[[safety]]
kind = "power_and_force"
name = "pfl"
robot = "a"
excluded = {excluded}
contact_area = {{ a = 1e-4 }}
mass = "{mass}"
{more}
"""


def contact_bounds(station):
    """Margins of a criterion of contact, and its bound on them, of looks between every two ticks."""
    (bound,) = station.bound
    contacts, between = Contacts(bound.criterion, station.model), None
    told, known = [], contacts.in_regions
    permitted = np.array([REGIONS[k] not in bound.criterion.excluded for k in known])

    def watching(i, watch, ends, state):
        low = between._low(watch, between._way, ends, state)
        for t in np.linspace(ends[0].t, ends[1].t, 7).tolist():
            _, _, shadow = between._look(i, watch, between._way, t, state)
            judged = contacts.judge(shadow)
            asked = judged.near[:, known] & permitted
            used = np.where(asked, judged.v[:, known] / judged.speeds.permissible, 0.0).max()
            told.append((low, 1 - used))
        return SpanResult()

    judge = Judge(station.bound)
    between = judge._between
    between._judge = watching
    for _ in ticks(engine_of(station.model), judge, pump(station.sources, 0.01), station.duration):
        pass
    return np.array(told).T


@pytest.mark.parametrize(
    ("seed", "mass", "more", "physics", "scale"),
    [
        (5, "larger", "", "false", 0.3),
        (6, "projected", "person_speed = 0.2", "true", 1.0),
        (7, "simplified", "", "false", 1.0),
        (14, "larger", 'human = "op"', "false", 1.0),
    ],
)
def test_no_contact_between_two_ticks_uses_more_than_its_bound(tmp_path, seed, mass, more, physics, scale):
    """Of every surface against every region, whatever it may come near to, and clamps, meanwhile."""
    rng = np.random.default_rng(seed)
    x, y = rng.normal(size=2) * 0.8
    cell = RANDOM[: RANDOM.index("[[safety]]")].replace("position = [0, 3, 0]", "position = [0.3, 0.9, 0]")
    text = cell + CONTACT.replace("{excluded}", str(NOT_HEAD)).replace("{x}", f"{x}").replace(
        "{y}", f"{y}"
    ).replace("{mass}", mass).replace("{more}", more)
    station = random_cell(tmp_path, rng, tick=0.01, physics=physics, rate=250, text=text, scale=scale)
    low, met = contact_bounds(station)
    assert (met >= low).all()
    assert np.isfinite(low).mean() > 0.9
    assert len(low) > 100


def shaking(size):
    """At rest at every tick of 10 ms, and at up to 2 · 100 π · size m/s between two."""

    def motion(t):
        angle = np.pi * t / 0.01 if 0.02 < t < 0.08 else 0.0
        return (size * np.sin(angle) ** 2, 0.0), (size * np.pi / 0.01 * np.sin(2 * angle), 0.0)

    return motion


def touching(folder, motion, more="", things="", kind="power_and_force", told=None):
    text = f"engine = {{ physics = false, gravity = [0, 0, 0] }}\n{TWO_R}{person('op', 2.4, 0.5, 0)}{things}"
    text += f'{SOURCE}[[safety]]\nkind = "{kind}"\nname = "c"\n{more}'
    files = {"arm.urdf": two_r(), "motion.csv": rows(motion, np.arange(0, 0.1001, 0.002).tolist())}
    if told is not None:
        text = f'variables = "v.toml"\n{text}active = "door"\n{PLC}'
        files |= {"v.toml": DOOR, "s.csv": "t,x\n" + "".join(f"{t},{x}\n" for t, x in told)}
    return made(folder, text, files).run().results["c"]


def contact(only="", **more):
    excluded = [name for name in REGIONS if name != only] if only else NOT_HEAD
    given = {"floor": "false", **more, "excluded": str(excluded), "contact_area": "{ arm = 1e-4 }"}
    return 'robot = "arm"\n' + "".join(f"{key} = {value}\n" for key, value in given.items())


HAND = "Hands and fingers"
OTHER = """
[[robots]]
name = "other"
model = "arm.urdf"
base = {{ position = [0, {y}, 0] }}
[[sources]]
kind = "csv"
robot = "other"
file = "still.csv"
"""
SHAKEN = {
    # How kinetic energy grows: at every tick there is none, and the tip is heavier than M/2 + m_L.
    "energy": (contact(mass='"larger"'), (0.0, 0.0), (0.004, 0.0), ""),
    # Two people, of whom the second comes within reach between ticks only.
    "people": (
        contact(human='"op"', horizon=0.1035),
        (0.0, 0.0),
        (0.004, 0.0),
        person("two", 2.15, 0.25, -0.8),
    ),
    # The tip comes 20 mm down, at 6 m/s; within the tick that may follow it clamps a hand.
    "floor": (contact(HAND, floor="true", floor_height=-0.2165), (0.0, 0.0), (0.01, 0.0), ""),
    # An elbow that closes.
    "elbow": (contact(mass='"simplified"'), (0.0, 2.9), (0.0, 0.01), ""),
    # Two arms that stand at every tick, each as seen from the other.
    "arms": (contact(mass='"simplified"'), (0.0, 0.0), (0.001, 0.0), OTHER.format(y=0.2)),
}


@pytest.mark.parametrize("what", SHAKEN)
def test_no_contact_of_an_arm_that_moves_only_between_ticks_uses_more_than_its_bound(tmp_path, what):
    options, place, size, more = SHAKEN[what]
    text = f"engine = {{ physics = false, gravity = [0, 0, 0] }}\n{TWO_R}{person('op', 2.4, 0.5, 0)}{more}"
    text += f'{SOURCE}[[safety]]\nkind = "power_and_force"\nname = "c"\n{options}'

    def motion(t):
        (way, _), (speed, _) = shaking(1.0)(t)
        return np.add(place, np.multiply(size, way)), np.multiply(size, speed)

    times = np.arange(0, 0.1001, 0.001).tolist()
    urdf = two_r(masses=(0.1, 4.0))
    if what == "floor":
        urdf = urdf.replace('<axis xyz="0 0 1"/>', '<axis xyz="0 1 0"/>')
    files = {"arm.urdf": urdf, "motion.csv": rows(motion, times)}
    files["still.csv"] = rows(lambda t: ((0.0, 0.0), (0.0, 0.0)), times)
    low, met = contact_bounds(made(tmp_path, text, files))
    assert (met >= np.minimum(low, 1.0)).all()  # of what stands still nothing is used
    assert (low > -np.inf).all()
    assert met.min() < 1.0


@pytest.mark.parametrize(("since", "exceeds"), [(0.0752, True), (0.0801, False)])
def test_what_is_too_near_just_when_a_criterion_begins_to_apply_is_exceeded(tmp_path, since, exceeds):
    """Of an S_p that looks ahead only the margins at both ends of a way bound what lies between."""
    separation = 'between = ["arm", "op"]\nstop = { reaction = 0.01, stopping = 0.1 }\nhuman_speed = 1.6\n'
    separation += "intrusion = 0\nhuman_uncertainty = 0\nrobot_uncertainty = 0\n"
    told = [(0, 0), (since, 1), (0.1, 1)]
    found = touching(tmp_path, shaking(0.01), separation, kind="separation", told=told)
    assert (found.verdict is Verdict.EXCEEDED) is exceeds
    assert (found.worst().t == pytest.approx(0.0775, abs=3e-3)) is exceeds


EVER = """
[[safety]]
kind = "separation"
name = "s"
mode = "{mode}"
between = ["arm", "op"]
stop = {{ reaction = 0.01, stopping = 0.1{ahead} }}
human_speed = {speed}
intrusion = 0
human_uncertainty = 0
robot_uncertainty = 0
"""
MEANT = '[[confirmed]]\nkey = "safety[0].stop.acceleration"\nof = "s"\nvalue = 0\nwhy = "present speeds"\n'
AROUND = '[[safety]]\nkind = "separation_area"\nname = "c"\nseparation = "s"\nof = "op"\n'


NEARING = np.sort(np.append(np.arange(51) * 0.002, [0.0245, 0.025, 0.0255]))


def nearing(faster):
    """To the person at 0.5 rad/s, and by some rad/s faster within a millisecond about 25 ms."""
    qd = 0.5 + np.where(NEARING == 0.025, faster, 0.0)
    q = np.concatenate([[0], np.cumsum((qd[1:] + qd[:-1]) / 2 * np.diff(NEARING))])
    return lambda t: ((np.interp(t, NEARING, q), 0.0), (np.interp(t, NEARING, qd), 0.0))


@pytest.mark.parametrize("mode", ["fixed", "dynamic"])
@pytest.mark.parametrize(
    ("kind", "ahead"), [("separation", ""), ("separation", ", acceleration = 0"), ("area", "")]
)
def test_a_fixed_separation_remembers_what_s_p_was_between_two_ticks(tmp_path, kind, ahead, mode):
    """At 0.7 rad/s for a moment between ticks, and 50 ms later as near as is enough for 0.5 rad/s alone."""

    def found(faster, speed):
        text = f"engine = {{ physics = false, gravity = [0, 0, 0] }}\n{TWO_R}{person('op', 2.4, 0.5, 0)}"
        text += SOURCE + EVER.format(mode=mode, speed=speed, ahead=ahead) + (AROUND if kind == "area" else "")
        text += MEANT if ahead else ""
        files = {"arm.urdf": two_r(), "motion.csv": rows(nearing(faster), NEARING.tolist())}
        summary = made(tmp_path / f"{faster}", text, files).run()
        return summary.results["c" if kind == "area" else "s"]

    steady = found(0.0, 1.6)
    # What comes when the log has ended, nobody knows, and up to then it comes nearer.
    speed = 1.6 + (float((steady.values - steady.limits)[7]) - 0.005) / 0.11
    moved = found(0.2, speed)
    # Where the motion is known ahead, the moment counts from the reaction time before it on.
    assert bool(moved.verdicts[:2].any()) is not ahead.endswith("= 0")
    assert bool(moved.verdicts[7]) is (mode == "fixed")


def test_a_contact_between_two_ticks_decides_though_nothing_moves_at_any_tick(tmp_path):
    slow = touching(tmp_path / "a", lambda t: ((0.05 * t, 0.0), (0.05, 0.0)), contact())
    assert (slow.verdict, slow.open) == (Verdict.WITHIN, "")
    assert touching(tmp_path / "b", shaking(0.02), contact()).verdict is Verdict.EXCEEDED
    accepted = contact(between_samples='"accepted: nobody is there"')
    assert touching(tmp_path / "c", shaking(0.02), accepted).verdict is Verdict.EXCEEDED


def test_accepted_is_what_nobody_knows_between_ticks_not_what_is_known_to_exceed(tmp_path):
    """Of an arm with tolerances nothing bounds contacts: what the file accepts then stands in its place."""
    said = 'between_samples = "accepted: contacts are measured"\n'
    unknown = contact(area_tolerance=0.1)
    slow = lambda t: ((0.05 * t, 0.0), (0.05, 0.0))  # noqa: E731
    found = [touching(tmp_path / f"{k}", slow, unknown + more) for k, more in enumerate(("", said))]
    assert [each.verdict for each in found] == [Verdict.UNDECIDED, Verdict.WITHIN]
    assert found[1].between == "accepted: contacts are measured"


@pytest.mark.parametrize(("beyond", "verdict"), [(0.001, Verdict.EXCEEDED), (0.1, None)])
def test_who_comes_within_reach_between_two_ticks_is_hit_there(tmp_path, beyond, verdict):
    near = 'between = ["arm", "op"]\n'
    distance = touching(tmp_path / "a", shaking(0.02), near, kind="minimum_distance").values[0]
    one = contact(human='"op"', horizon=distance - beyond)
    assert touching(tmp_path / "b", shaking(0.02), one).verdict is verdict


@pytest.mark.parametrize(("gap", "verdict"), [(0.102, Verdict.EXCEEDED), (0.3, None)])
def test_what_clamps_a_hand_only_between_two_ticks_is_exceeded(tmp_path, gap, verdict):
    """At 1.2 m/s, which is permitted where the hand is free and not where it is clamped: in 100 mm."""
    wall = (
        "[[parts]]\nname = 'wall'\nshape = {{ box = [0.1, 0.1, 1] }}\nat = {{ position = [1.9, {y}, 0] }}\n"
    )
    hand = contact("Hands and fingers", mass='"simplified"')
    found = touching(tmp_path, shaking(0.002), hand, wall.format(y=0.05 + 0.05 + gap))
    assert found.verdict is verdict


# -- and none is so wide that what nears its limits is open --------------------------------------

POLE = '[[parts]]\nname = "pole"\nshape = { box = [0.05, 0.05, 2] }\nat = { position = [1.6, 0, 0.5] }\n'
NEAR = """
[[safety]]
kind = "velocity"
name = "speed"
of = "arm"
limit = {speed}
[[safety]]
kind = "minimum_distance"
name = "distance"
between = ["arm", "pole"]
limit = {distance}
[[safety]]
kind = "kinetic_energy"
name = "energy"
robot = "arm"
limit = {energy}
"""


def reaching(folder, **limits):
    """A UR10 that swings past a pole at nearly 1 m/s, told at 125 Hz and asked at 100 Hz."""
    t = np.arange(0, 0.6, 0.008)
    q = np.tile([-0.4, -1.2, 1.4, -1.5, -1.5, 0.0], (len(t), 1))
    q[:, 0] += t
    q[:, 3] += 0.2 * np.sin(3 * t)
    lines = ["t [s]," + ",".join(f"j{k} [rad]" for k in range(6))]
    lines += [",".join(f"{x:.9f}" for x in row) for row in np.column_stack([t, q])]
    return made(folder, UR10 + POLE + SOURCE + NEAR.format(**limits), {"motion.csv": "\n".join(lines) + "\n"})


def test_a_ur10_that_nears_its_limits_by_a_thousandth_is_within_throughout(tmp_path):
    far = reaching(tmp_path / "far", speed=9, distance=0, energy=900).run().results
    near = {"speed": far["speed"].max() * 1.001, "energy": far["energy"].max() * 1.001}
    assert near["speed"] > 0.9
    summary = reaching(tmp_path / "near", distance=far["distance"].min() - 0.001, **near).run()
    assert {series.verdict for series in summary.results.values()} == {Verdict.WITHIN}
