"""What moves a robot, and what is no robot: carts and doors keep away from people, too."""

from __future__ import annotations

import numpy as np
import pytest
from msgspec.structs import replace

from made_cell import heard, made, person, two_r
from seerob.core.errors import InputError
from seerob.core.verdict import Verdict
from seerob.criteria.judging import Judge
from seerob.recording.series import CODES
from seerob.twin.engine import Engine

VARIABLES = "".join(
    f'[[variables]]\nname = "{name}"\nsource = "plc"\naddress = "{name}"\nunit = "{unit}"\n'
    for name, unit in (("x", "m"), ("y", "m"), ("heading", "rad"), ("angle", "rad"))
)
CELL = (
    'variables = "variables.toml"\n[engine]\nphysics = false\ngravity = [0, 0, 0]\n'
    + person("op", 2.0, 0, 0)
    + """
[[sources]]
kind = "signals_csv"
name = "plc"
file = "signals.csv"
time = "t"
time_unit = "s"
[[machines]]
name = "agv"
shape = { box = [1.0, 0.6, 0.3] }
at = { position = [0, 0, 0.2] }
mass = 100
uniform_density = true
vehicle = { x = "x", y = "y", heading = "heading" }
[[robots]]
name = "arm"
model = "arm.urdf"
on = "agv"
rotor_inertia = [0.0, 0.0]
base = { position = [-0.4, 0, 1.5] }
"""
)
FILES = {
    "arm.urdf": two_r(),
    "variables.toml": VARIABLES,
    "signals.csv": "t,x,y,heading,angle\n0,0,0,0,0\n1,0,0,0,0\n",
}
STOP = "stop = { reaction = 0.1, stopping = 0.3, acceleration = 0 }\n"
TERMS = "human_speed = 1.6\nintrusion = 0\nhuman_uncertainty = 0\nrobot_uncertainty = 0\n"


def separation(who):
    return f'[[safety]]\nkind = "separation"\nname = "{who}"\nbetween = ["{who}", "op"]\n' + STOP + TERMS


def judged(folder, criteria, *, v=1.0, x=0.0, arm=(np.pi, 0.0)):
    """Results by name with the cart at x [m] and v [m/s], the arm turned away from the person."""
    station = made(folder, CELL + criteria, FILES)
    engine = Engine(station.model, driven={"agv": 1.0, "arm": 1.0}, live={"agv", "arm"})
    engine.take([heard("agv", 0.0, (x, 0.0, 0.0), (v, 0.0, 0.0)), heard("arm", 0.0, arm, (0.0, 0.0))])
    return {r.name: r for r in Judge(station.bound, station.model.findings)(engine.start())}, station


def test_a_cart_is_judged_like_a_robot_and_with_the_robot_that_it_carries(tmp_path):
    """Its front is a few centimetres from the person, the arm a metre behind it."""
    found, _ = judged(tmp_path, separation("arm") + separation("agv"), x=1.35)
    for name in ("arm", "agv"):
        assert found[name].verdict is Verdict.EXCEEDED
        assert found[name].reason.startswith("agv/")
        assert found[name].value < 0.15
        assert found[name].limit == pytest.approx((1.0 + 1.6) * 0.4)
    assert {part.name for part in found["arm"].parts} >= {"agv/body", "arm/l1", "arm/l2"}


def test_what_nobody_said_of_a_cart_s_acceleration_leaves_it_open(tmp_path):
    quiet = separation("agv").replace(", acceleration = 0", "")
    found, _ = judged(tmp_path, quiet, x=-5.0)
    assert found["agv"].verdict is Verdict.UNDECIDED
    assert "how fast agv may get faster" in found["agv"].reason
    near, _ = judged(tmp_path / "near", quiet, x=1.0)
    assert near["agv"].verdict is Verdict.EXCEEDED


@pytest.mark.parametrize("stop", ['model = "simulated"', 'model = "table", table = "ur10_cb3"'])
def test_a_cart_has_neither_brakes_nor_a_table_of_a_robot(tmp_path, stop):
    wrong = separation("agv").replace("stopping = 0.3", stop)
    with pytest.raises(InputError, match="agv is a machine"):
        _ = made(tmp_path, CELL + wrong, FILES).bound


DISTANCE = '[[safety]]\nkind = "minimum_distance"\nname = "d"\nbetween = ["arm", "op"]\nlimit = 0.5\n'
ENERGY = '[[safety]]\nkind = "kinetic_energy"\nname = "{0}"\nrobot = "{0}"\nlimit = 240\n'
AREA = (
    '[[areas]]\nname = "front"\nshape = { box = [1, 1, 0.4] }\nat = { position = [1.5, 0, 0.2] }\n'
    '[[safety]]\nkind = "safety_area"\nname = "a"\narea = "front"\nof = "arm"\n'
)


def test_the_name_of_a_carried_robot_means_what_carries_it(tmp_path):
    found, station = judged(tmp_path, DISTANCE + AREA, x=1.0)
    assert (found["d"].verdict, found["a"].verdict) == (Verdict.EXCEEDED, Verdict.EXCEEDED)
    names = {station.model.bodies[i].name for i in station.model.select("arm")}
    assert "agv/body" in names
    assert not [i for i in station.model.select("arm/*") if station.model.bodies[i].owner == "agv"]


def test_nothing_of_an_arm_is_within_while_nobody_asks_about_what_carries_it(tmp_path):
    found, station = judged(tmp_path, ENERGY.format("arm"), v=0.01)
    assert found["arm"].verdict is Verdict.UNDECIDED
    assert "not evaluated: agv moves and carries arm" in found["arm"].reason
    (finding,) = [f for f in station.model.findings if f.subject == "agv" and "not evaluated" in f.text]
    assert finding.holds == ("arm",)
    both, _ = judged(tmp_path / "both", ENERGY.format("arm") + ENERGY.format("agv"), v=0.01)
    assert {both[name].verdict for name in ("arm", "agv")} == {Verdict.WITHIN}


def test_the_energy_of_a_cart_has_that_of_the_arm_on_it(tmp_path):
    found, station = judged(tmp_path, ENERGY.format("agv") + ENERGY.format("arm"), v=2.0)
    masses = station.model.mj.body_mass
    arm = masses[station.model.robot("arm").mj_bodies].sum()
    assert found["arm"].value == pytest.approx(0.5 * arm * 4)
    assert found["agv"].value == pytest.approx(0.5 * (100 + arm) * 4, rel=1e-3)


def test_a_door_that_nobody_asks_about_is_told(tmp_path):
    door = (
        '[[machines]]\nname = "door"\nmass = 20\n'
        'shape = { box = [0.8, 0.05, 2] }\nat = { position = [3, 1, 1] }\nturn = { angle = "angle" }\n'
    )
    _, station = judged(tmp_path, door + separation("arm"))
    told = [f for f in station.model.findings if "not evaluated" in f.text]
    assert [(f.subject, f.holds) for f in told] == [("door", ())]
    assert 'between = ["door", "op"]' in told[0].text


def test_the_energy_of_a_cart_that_carries_nobody_is_the_same_in_arrays(tmp_path):
    text = CELL[: CELL.index("[[robots]]")] + ENERGY.format("agv")
    rows = "".join(f"{0.01 * k:.2f},{0.001 * k * k:.6f},0,0,0\n" for k in range(21))
    station = made(tmp_path, text, {**FILES, "signals.csv": "t,x,y,heading,angle\n" + rows})
    run, column = station.run().results["agv"], station.batch()["agv"]
    assert np.nanmax(run.values) > 100
    np.testing.assert_allclose(column.value, run.values, rtol=1e-9)
    np.testing.assert_array_equal(column.answers.verdict, run.verdicts)


def _log(t, *columns):
    """A log of joints [m or rad] by instants."""
    rows = [",".join(["t [s]", *(f"j{i} [{unit}]" for i, (unit, _) in enumerate(columns))])]
    rows += [
        ",".join(map(repr, row)) for row in zip(t.tolist(), *(q.tolist() for _, q in columns), strict=True)
    ]
    return "\n".join(rows) + "\n"


T = np.arange(0, 1.001, 0.01)
GOES = np.maximum(T - 0.5, 0.0) ** 2
"""Stands for half a second, then gets faster by 2 m/s² [m]."""
LOGS = {
    "arm.urdf": two_r(),
    "moves.csv": _log(T, ("m", GOES)),
    "arm.csv": _log(T, ("rad", np.pi + 0.001 * np.sin(T)), ("rad", 0 * T)),
}


def recorded(x, mounted, machine):
    """A person at x, an arm that stands, and a machine that gets faster."""
    sources = {"arm": "arm.csv", "mover": "moves.csv"}
    return (
        "[engine]\nphysics = false\ngravity = [0, 0, 0]\n"
        + person("op", x, 0, 0)
        + f'[[robots]]\nname = "arm"\nmodel = "arm.urdf"\nrotor_inertia = [0.0, 0.0]\n{mounted}'
        + f'[[machines]]\nname = "mover"\n{machine}'
        + "".join(f'[[sources]]\nkind = "csv"\nrobot = "{k}"\nfile = "{f}"\n' for k, f in sources.items())
        + separation("arm").replace(STOP, f"stop = {{ reaction = {T_R}, stopping = {T_S} }}\n")
    )


T_R, T_S = 0.4, 0.1


def required(t):
    """S_p of what gets faster by 2 m/s² from 0.5 s on, for a stop that begins at the end of T_r."""
    end = t + T_R
    v_s, way = 2 * max(end - 0.5, 0.0), max(end - 0.5, 0.0) ** 2 - max(t - 0.5, 0.0) ** 2
    return 1.6 * (T_R + T_S) + way + v_s * T_S


def test_what_a_carrier_does_while_a_recorded_arm_reacts_is_open_in_arrays_as_in_a_run(tmp_path):
    """The arm's S_p was that of the carrier's present speed, while it gets faster."""
    cart = (
        "mass = 100\nuniform_density = true\nshape = { box = [1.0, 0.6, 0.3] }\n"
        "at = { position = [0.1, 0, 0.2] }\n"
        "slide = { along = [1, 0, 0], lower = -1, upper = 3 }\n"
    )
    text = recorded(2.0, 'on = "mover"\nbase = { position = [-0.4, 0, 1.5] }\n', cart)
    station = made(tmp_path, text, LOGS)
    run = station.run().results["arm"]
    arrays = {"arm": np.stack([np.pi + 0 * T, 0 * T], 1), "mover": GOES[:, None]}
    speeds = {"arm": np.zeros((len(T), 2)), "mover": 2 * np.maximum(T - 0.5, 0.0)[:, None]}
    for column in (station.batch()["arm"], station.batch(arrays, speeds, t=T)["arm"]):
        said = column.answers.verdict
        np.testing.assert_array_equal(said[:-1], run.verdicts[:-1])
        beyond = np.array([required(t) for t in T]) > column.value
        assert (column.value > column.answers.limit)[beyond].any()
        assert not (said[beyond] == 0).any()


def test_what_an_arm_carries_may_get_faster_by_itself_while_it_reacts(tmp_path):
    """A slide on a flange that stands, whose present speed alone was in S_p of the arm."""
    ram = (
        'on = "arm/tip"\nshape = { box = [0.3, 0.1, 0.1] }\nmass = 1\nuniform_density = true\n'
        "slide = { along = [1, 0, 0], lower = 0, upper = 0.6 }\n"
    )
    files = LOGS | {"arm.csv": _log(T, ("rad", 0.001 * np.sin(T)), ("rad", 0 * T))}
    text = recorded(3.5, "", ram)
    found = made(tmp_path, text, files).run().results["arm"]
    beyond = np.array([required(t) for t in T]) > np.array(found.values)
    assert (np.array(found.values) > np.array(found.limits))[beyond].any()
    assert not (np.array(found.verdicts)[beyond] == 0).any()
    far = made(tmp_path / "far", text.replace("3.5, 0, 0", "4.6, 0, 0"), files).run().results["arm"]
    assert (np.array(far.verdicts)[:90] == 0).all()
    near = made(tmp_path / "near", text.replace("3.5, 0, 0", "3.9, 0, 0"), files).run().results["arm"]
    reasons = {near.reasons[k] for k in np.flatnonzero(near.verdicts == CODES[Verdict.UNDECIDED])}
    assert any("if mover goes all of its stroke: give stop.acceleration" in text for text in reasons)
    assert not any("as fast as it can be" in text for text in reasons)


def test_what_masses_and_a_stroke_may_add_to_a_simulated_stop_counts_together(tmp_path):
    """The stroke of what an arm carries took the place of what its masses may be off by."""
    ram = 'on = "arm/tip"\nshape = { box = [0.3, 0.1, 0.1] }\nmass = 1\nuniform_density = true\n'
    ram += "slide = { along = [1, 0, 0], "
    stop = f'stop = {{ reaction = {T_R}, model = "simulated", brakes = [4.0, 4.0] }}\n'
    files = LOGS | {"arm.csv": _log(T, ("rad", T), ("rad", 0 * T)), "moves.csv": _log(T, ("m", 0 * T))}

    def more(tolerance, stroke):
        text = recorded(9, tolerance, f"{ram}lower = 0, upper = {stroke} }}\n")
        text = text.replace(f"stop = {{ reaction = {T_R}, stopping = {T_S} }}\n", stop)
        folder = tmp_path / f"{len(tolerance)} {stroke}"
        series = made(folder, text, files).run(stop=lambda: True).results["arm"]
        return series.parts["S_p may be larger by"].values[0]

    off = "mass_tolerance = 0.5\n"
    assert more("", 0.6) == pytest.approx(0.6)
    assert more(off, 0.001) > 1
    assert more(off, 0.6) - more(off, 0.001) == pytest.approx(0.599)


SPEEDS = (
    '[[safety]]\nkind = "velocity"\nname = "point"\nat = "arm"\nlimit = 1.2\n'
    '[[safety]]\nkind = "velocity"\nname = "all"\nof = "arm/*"\nlimit = 1.2\n'
    '[[safety]]\nkind = "kinetic_energy"\nname = "energy"\nrobot = "arm"\nlimit = {limit}\n'
)


def test_noise_of_what_carries_an_arm_leaves_its_speed_and_energy_open(tmp_path):
    def said(name, limit, off):
        criteria = SPEEDS.format(limit=limit) + separation("agv")
        station = made(tmp_path / name, CELL + criteria, FILES)
        engine = Engine(station.model, driven={"agv": 1.0, "arm": 1.0}, live={"agv", "arm"})
        cart = replace(heard("agv", 0.0, (-9.0, 0.0, 0.0), (1.0, 0.0, 0.0)), qd_error=off)
        engine.take([cart, heard("arm", 0.0, (np.pi, 0.0), (0.0, 0.0))])
        return {r.name: r for r in Judge(station.bound, station.model.findings)(engine.start())}

    value = said("first", 1e6, None)["energy"].value
    sure, open_ = (said(str(off), 1.5 * value, off) for off in (None, (0.5, 0.0, 0.0)))
    for name in ("point", "all", "energy"):
        assert sure[name].verdict is Verdict.WITHIN, name
        assert open_[name].verdict is Verdict.UNDECIDED, name
        assert "noise" in open_[name].reason


@pytest.mark.parametrize(("off", "more"), [("", 0.0), ("mass_tolerance = 0.1\n", 0.1)])
def test_what_carries_an_arm_whose_masses_are_off_has_the_interval_of_the_arms_energy(tmp_path, off, more):
    """The cart goes at 1 m/s: half of what the links weigh more or less."""
    criterion = '[[safety]]\nkind = "kinetic_energy"\nname = "all"\nrobot = "agv"\nlimit = 200\n'
    text = CELL.replace('name = "arm"\n', f'name = "arm"\n{off}', 1) + criterion
    station = made(tmp_path, text, FILES)
    engine = Engine(station.model, driven={"agv": 1.0, "arm": 1.0})
    cart, arm = (
        heard("agv", 0.0, (-9.0, 0.0, 0.0), (1.0, 0.0, 0.0)),
        heard("arm", 0.0, (np.pi, 0.0), (0.0, 0.0)),
    )
    engine.take([cart, arm])
    (found,) = (r for r in Judge(station.bound, station.model.findings)(engine.start()) if r.name == "all")
    assert found.verdict == "within", found.reason
    links = sum(link.inertial.mass for link in station.model.robot("arm").description.links if link.inertial)
    low, high = found.interval or (found.value, found.value)
    assert (found.value - low, high - found.value) == pytest.approx((more * links / 2,) * 2, rel=1e-3)
