"""Where motions begin and end: nothing stands still because nobody spoke, and a rounding is no end."""

from __future__ import annotations

import numpy as np
import pytest

from made_cell import FLOATING, TWO_R, heard, made, person, two_r
from seerob.core.snapshot import Verdict
from seerob.files.trajectories.trajectory import derive_velocities
from seerob.recording.recording import Recording
from seerob.session.run import engine_of, pump, ticks
from seerob.twin.control.reference import Reference
from seerob.twin.engine import Engine
from seerob.workstation.source import Opened, Pump

TICK = 0.01
PLACED = "engine = { gravity = [0, 0, 0], physics = false }\n"
WATCHED = '[[safety]]\nkind = "velocity"\nname = "v"\nat = "arm/l1"\noffset = [1, 0, 0]\nlimit = 0.5\n'


@pytest.fixture(scope="module")
def cells(tmp_path_factory):
    folder = tmp_path_factory.mktemp("ends")
    return {
        physics: made(folder / str(physics), head + TWO_R + WATCHED, {"arm.urdf": two_r()}).model
        for physics, head in ((True, FLOATING), (False, PLACED))
    }


def run(model, samples, until, *, live=()):
    """The states' speeds of the first joint at each tick [rad/s], None where they may not be relied on."""
    engine = Engine(model, driven={"arm": 0.2}, live=live)
    pump = Pump(Opened(samples=samples, duration=samples[-1].t))
    found = []
    for k in range(round(until / TICK) + 1):
        engine.take(list(pump.until(k * TICK)))
        state = engine.tick() if k else engine.start()
        found.append(None if state.invalid_reason("arm") else float(state.qd(model.robot("arm"))[0]))
    return found


def accelerating(end, rate=100.0, *, speeds=True):
    """At 2 rad/s² from rest until an instant."""
    times = np.append(np.arange(0.0, end - 0.5 / rate, 1 / rate), end).tolist()
    return tuple(heard("arm", t, (t * t, 0.0), (2 * t, 0.0) if speeds else None) for t in times)


@pytest.mark.parametrize("physics", [True, False])
@pytest.mark.parametrize("off", [-1, 0, 1])
def test_the_last_tick_of_a_log_moves_whatever_its_length_is_rounded_to(cells, physics, off):
    end = 0.35
    for _ in range(abs(off)):
        end = float(np.nextafter(end, np.inf * off))
    speeds = run(cells[physics], accelerating(end), 0.35)
    assert speeds[-1] == pytest.approx(0.70, abs=0.02)


@pytest.mark.parametrize("period", [0.01, 0.008, 1 / 3, 0.1, 1e-3 * 7])
def test_no_multiple_of_any_tick_is_past_a_log_that_ends_there(period):
    """Sums of decimals: k · tick against the last stamp as a file has it, with a few digits."""
    for k in range(1, 400, 7):
        for end in (float(f"{k * period:.12g}"), k * period, sum([period] * k)):
            reference = Reference(np.zeros(1))
            reference.take(end - period, np.array([0.0]), np.array([1.0]))
            reference.take(end, np.array([period]), np.array([1.0]))
            assert reference.at(k * period)[1][0] == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize("physics", [True, False])
@pytest.mark.parametrize("speeds", [True, False])
def test_a_motion_that_ends_is_not_a_motion_that_stopped(cells, physics, speeds):
    found = run(cells[physics], accelerating(0.35, speeds=speeds), 0.4)
    assert found[35] == pytest.approx(0.70, abs=0.02)
    assert found[36:] == [None] * 5


def test_a_motion_that_ends_at_rest_stands_until_its_time_out(cells):
    times = np.arange(0, 0.3 + 1e-9, 0.01).tolist()
    rest = tuple(heard("arm", t, (0.5 + 1e-4 * (-1) ** k, 0.0), (0.0, 0.0)) for k, t in enumerate(times))
    found = run(cells[False], rest, 0.52)
    assert found[:50] == [0.0] * 50
    assert found[-1] is None


def test_what_is_heard_live_coasts_until_its_time_out(cells):
    found = run(cells[False], accelerating(0.35), 0.6, live=["arm"])
    assert found[36:55] == [pytest.approx(0.70)] * 19
    assert found[-3:] == [None] * 3


@pytest.mark.parametrize("cut", [0.05, 0.123, 0.2, 0.35])
def test_a_log_that_is_cut_never_moves_more_slowly_at_its_last_tick(cells, cut):
    def motion(end):
        times = [*np.arange(0.0, end, 0.008).tolist(), end]
        return tuple(heard("arm", t, (np.sin(3 * t), 0.0), (3 * np.cos(3 * t), 0.0)) for t in times)

    whole, short = (run(cells[False], motion(end), 0.4) for end in (0.4, cut))
    last = int(cut / TICK + 1e-9)
    assert short[last] == pytest.approx(whole[last], rel=1e-4)
    assert short[last + 1 :] == [None] * (40 - last)


def test_no_velocity_is_derived_across_a_jump_or_a_row_that_is_not_known():
    t = np.arange(12) * 0.01
    q = np.column_stack([t * t, -t])
    known = np.ones(12, bool)
    known[8] = False
    broken = q.copy()
    broken[4:] += 0.4
    broken[8] = 17.0
    found = derive_velocities(t, broken, largest=30.0, known=known).qd
    right = np.column_stack([2 * t, np.full(12, -1.0)])
    np.testing.assert_allclose(found[known], right[known], atol=1e-9)
    np.testing.assert_array_equal(found[8], 0.0)


@pytest.mark.parametrize("start", [0.0, 0.1, 0.3, 1 / 3, 1234.567])
@pytest.mark.parametrize("rate", [100.0, 125.0])
def test_no_start_time_changes_what_a_motion_is_at_its_ticks(cells, start, rate):
    """A file on a clock of its own: t - t[0] is off by rounding, and no tick falls between two samples."""
    clock = [start + k / rate for k in range(int(0.4 * rate) + 1)]
    times = [t - start for t in clock]
    motion = tuple(heard("arm", t, (np.sin(3 * t), 0.0), (3 * np.cos(3 * t), 0.0)) for t in times)
    found = run(cells[False], motion, 0.4)
    wanted = 3 * np.cos(3 * TICK * np.arange(41))
    known = [k for k, speed in enumerate(found) if speed is not None]
    # A clock of large numbers ends up to 1e-12 s early, which is no end.
    assert known == list(range(41))
    np.testing.assert_allclose([found[k] for k in known], wanted, atol=2e-4)


# -- a motion that ends within a tick ------------------------------------------------------------


def log(end, rate=250):
    """A file of what accelerates at 4 rad/s² until an instant: 1 m out it is at 4 · end m/s then."""
    times = np.append(np.arange(0.0, end - 0.5 / rate, 1 / rate), end)
    rows = [f"{t:.6f},{2 * t * t:.12g},0,{4 * t:.12g},0" for t in times]
    return "\n".join(["t [s],j1 [rad],j2 [rad],qd_j1 [rad/s],qd_j2 [rad/s]", *rows]) + "\n"


def until(folder, end, limit, physics):
    text = (FLOATING if physics else PLACED) + TWO_R + WATCHED.replace("0.5", f"{limit:g}")
    text += '[[sources]]\nkind = "csv"\nrobot = "arm"\nfile = "log.csv"\n[[sinks]]\nkind = "recorder"\n'
    return made(folder, text, {"arm.urdf": two_r(), "log.csv": log(end)})


@pytest.mark.parametrize("physics", [True, False])
@pytest.mark.parametrize("end", [0.499, 0.4942, 0.4906])
def test_a_motion_is_judged_to_its_end_wherever_that_lies_in_a_tick(tmp_path, end, physics):
    exceeded, within = (
        until(tmp_path / str(k), end, 4 * end - off, physics) for k, off in enumerate((0.003, -0.03))
    )
    for station, verdict in ((exceeded, Verdict.EXCEEDED), (within, Verdict.WITHIN)):
        summary = station.run(folder=tmp_path / verdict, sinks=station.workstation.sinks)
        found = summary.results["v"]
        assert (summary.verdict, summary.duration) == (verdict, pytest.approx(end, abs=1e-9))
        assert found.max() == pytest.approx(4 * end, abs=2e-3)
        again = station.replay(Recording.open(tmp_path / verdict / "run.mcap"))
        assert again.verdict is verdict
        np.testing.assert_array_equal(again.results["v"].values, found.values)
        np.testing.assert_array_equal(again.results["v"].t, found.t)
        batch = station.batch()
        assert batch["v"].verdict is verdict
        assert batch.t[-1] == pytest.approx(end, abs=1e-9)
        *others, length = np.diff(batch.t).tolist()
        assert others == pytest.approx([TICK] * len(others))
        assert 0.5 <= length / TICK <= 1.5


@pytest.mark.parametrize("end", [0.4955, 0.0952, 0.003])
def test_a_last_tick_of_another_length_moves_no_twin_away(tmp_path, end):
    """The steps of the physics are shorter there; the twin stays on what was heard."""
    station = until(tmp_path, end, 3, True)
    engine = engine_of(station.model)
    for out, _ in ticks(engine, lambda _: (), pump(station.sources, TICK), station.duration):
        t = out.t
    assert t == pytest.approx(end, abs=1e-12)
    found = engine.state.qd(station.model.robot("arm"))[0], engine.state.q(station.model.robot("arm"))[0]
    assert found == pytest.approx((4 * end, 2 * end * end), abs=1e-3)


def test_who_does_not_say_when_a_motion_ends_gets_no_verdict_past_it(tmp_path):
    station = until(tmp_path, 0.499, 3, False)
    assert station.run().verdict is Verdict.WITHIN
    assert station.run(feed=pump(station.sources, TICK)).verdict is Verdict.UNDECIDED


def test_a_reaction_time_between_two_ticks_is_looked_ahead_to_the_tick_after_it(tmp_path):
    """Of samples that come twice a tick the last of them was missing, so that a motion seemed to end."""
    t = np.arange(0, 0.4001, 0.005)
    rows = "".join(f"{a:.3f},{0.2 * a:.9f},0\n" for a in t.tolist())
    text = (
        FLOATING.replace("{ ", "{ physics = false, ")
        + TWO_R
        + person("op", 8, 0, -1)
        + '[[sources]]\nkind = "csv"\nrobot = "arm"\nfile = "arm.csv"\n[[safety]]\nkind = "separation"\n'
        'name = "S"\nbetween = ["arm", "op"]\nintrusion = 0\nhuman_uncertainty = 0\nrobot_uncertainty = 0\n'
        "stop = { reaction = 0.082, stopping = 0.1 }\n"
    )
    files = {"arm.urdf": two_r(), "arm.csv": "t [s],j0 [rad],j1 [rad]\n" + rows}
    found = made(tmp_path, text, files).run().results["S"]
    assert not any("its motion ends" in reason for reason in found.reasons[:30])
    assert "its motion ends" in found.reasons[-1]
