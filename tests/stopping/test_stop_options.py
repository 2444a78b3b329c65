"""Which options of a stop go together, what it says of itself, and its largest permissible speed by hand."""

from __future__ import annotations

import numpy as np
import pytest

from seerob.core.snapshot import Origin
from seerob.core.tolerances import Tolerance
from seerob.criteria.stopping.models import MOVING, SHARE, Stop, StopTolerance, bind_stop
from seerob.criteria.stopping.onset import accelerated
from seerob.criteria.stopping.required import approach_speed, intrusion, shifted, tolerances
from seerob.criteria.stopping.terms import (
    BOUND,
    CONSTANT,
    braking,
    largest_speed_decelerating,
    largest_speed_in_time,
    separation_distance,
)

KNOWN = {"acceleration": 0.0, "reaction": 0.1, "stopping": 0.3}
HALF = {**KNOWN, "model": "constant_deceleration"}
BRAKING = {"acceleration": 0.0, "reaction": 0.1, "deceleration": 2.0, "model": "constant_deceleration"}
TABLE = {"reaction": 0.1, "model": "table", "table": "ur10_cb3"}
SIMULATED = {"reaction": 0.1, "model": "simulated"}
OFF = StopTolerance


@pytest.mark.parametrize(
    "options",
    [
        KNOWN,
        HALF,
        BRAKING,
        {**TABLE, "table_for": "arm", "rated_payload": 5.0, "stopping": 0.5},
        {**SIMULATED, "brakes": (1.0,), "direction": "toward"},
        {**SIMULATED, "torque_share": 0.5},
        {**KNOWN, "tolerance": OFF()},
        {**KNOWN, "tolerance": OFF(reaction=0.0999, stopping=0.2999)},
        {**BRAKING, "tolerance": OFF(deceleration=1.9999)},
    ],
)
def test_options_that_go_together(options):
    assert Stop(**options).reaction == 0.1


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"reaction": 0.1}, '"bound" needs stopping$'),
        ({**HALF, "deceleration": 2.0}, "needs either stopping or deceleration$"),
        ({"reaction": 0.1, "model": "constant_deceleration"}, "needs either stopping or deceleration$"),
        ({"reaction": 0.1, "model": "table"}, '"table" needs table$'),
        ({**KNOWN, "deceleration": 2.0}, "deceleration does nothing"),
        ({**KNOWN, "table": "ur10_cb3"}, "table does nothing"),
        ({**KNOWN, "table_for": "arm"}, "table_for does nothing"),
        ({**KNOWN, "rated_payload": 5.0}, "rated_payload does nothing"),
        ({**SIMULATED, "stopping": 0.3}, "stopping does nothing"),
        ({**KNOWN, "brakes": (1.0,)}, "brakes does nothing"),
        ({**KNOWN, "torque_share": 0.5}, "torque_share does nothing"),
        ({**SIMULATED, "torque_share": 0.5, "brakes": (1.0,)}, "torque_share does nothing"),
        ({**KNOWN, "direction": "toward"}, "direction does nothing"),
        ({**KNOWN, "tolerance": OFF(reaction=0.1)}, r"reaction = 0\.1, but reaction = 0\.1 is not more"),
        ({**KNOWN, "tolerance": OFF(deceleration=0.1)}, r"= 0\.1, but deceleration is not given$"),
    ],
)  # fmt: skip
def test_options_that_do_not(options, said):
    with pytest.raises(ValueError, match=said):
        Stop(**options)


def test_brakes_have_eight_tenths_of_the_torque_limits_unless_the_file_says_otherwise():
    assert Stop(**SIMULATED).torque_share == SHARE == 0.8


def known(options):
    found, how = bind_stop(Stop(**options), None, None, None).inputs
    assert (how.name, how.value, how.origin) == ("acceleration during T_r", 0.0, "given")
    return found.name, found.value, found.unit, found.origin


def test_what_a_stop_says_of_itself():
    assert known(KNOWN) == known(HALF) == ("T_s", 0.3, "s", "given")
    assert known(BRAKING) == ("deceleration", 2.0, "m/s²", "given")
    formulas = [bind_stop(Stop(**options), None, None, None).formula for options in (KNOWN, HALF, BRAKING)]
    half = "S_s = v_s T_s / 2"
    assert formulas == ["S_s = v_s T_s", half, f"{half}, T_s = v_s / a of the fastest point"]


# -- the largest permissible speed ----------------------------------------------------------------

D, V_H, K, T_R = np.array([2.0, 2.6]), np.array([1.6, 1.7]), 0.35, 0.1


def onsets(v, a=0.0):
    """At rest and at speeds [m/s]."""
    return [accelerated(scale * v, T_R, a, np.zeros(0)) for scale in (0.0, 1.0)]


def lacks(options, v):
    """By how much the part that is worst off is too near, at speeds [m/s]."""
    a = options.get("deceleration")
    T_s = options.get("stopping") if a is None else v.max() / a
    share = 0.5 if options.get("model") else 1.0
    return (V_H * (T_R + T_s) + v * T_R + share * v * T_s + K - D).max()


@pytest.mark.parametrize("options", [KNOWN, HALF, BRAKING])
@pytest.mark.parametrize("v", [(1.0, 2.5), (0.7, 0.4), (MOVING, 0.0)])
def test_at_the_largest_factor_the_worst_part_is_as_near_as_it_may_be(options, v):
    v = np.array(v)
    speed, factor = bind_stop(Stop(**options), None, None, None).inverse(*onsets(v), D, V_H, K)
    assert speed == pytest.approx(factor * v.max(), rel=1e-12)
    assert lacks(options, factor * v) == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize("v", [(0.0, 0.0), (0.0, 0.999 * MOVING)])
def test_at_rest_each_part_may_be_the_fastest(v):
    inverse = {k: bind_stop(Stop(**o), None, None, None).inverse for k, o in
               {BOUND: KNOWN, CONSTANT: HALF, None: BRAKING}.items()}  # fmt: skip
    for share in (BOUND, CONSTANT):
        each = largest_speed_in_time(D, V_H, T_R, 0.3, K, share)
        assert each[0] < each[1]
        assert inverse[share](*onsets(np.array(v)), D, V_H, K) == (each[0], None)
    each = largest_speed_decelerating(D, V_H, T_R, 2.0, K)
    assert each[0] < each[1]
    assert inverse[None](*onsets(np.array(v)), D, V_H, K) == (each[0], None)


# -- tolerances -----------------------------------------------------------------------------------


def test_a_stop_at_the_ends_of_its_tolerances():
    """S_p is largest with long times and a small deceleration."""
    times = Stop(**KNOWN, tolerance=OFF(reaction=0.02, stopping=0.05))
    assert tolerances(times) == (Tolerance("stop.reaction", 0.02, "s"), Tolerance("stop.stopping", 0.05, "s"))
    for side in (-1, 0, 1):
        found = shifted(times, (side, -side))
        assert (found.reaction, found.stopping) == pytest.approx((0.1 + side * 0.02, 0.3 - side * 0.05))
        assert found.tolerance is None
    brakes = Stop(**BRAKING, tolerance=OFF(deceleration=0.5))
    assert tolerances(brakes) == (Tolerance("stop.deceleration", 0.5, "m/s²"),)
    assert [shifted(brakes, (side,)).deceleration for side in (-1, 1)] == [2.5, 1.5]
    assert tolerances(Stop(**KNOWN)) == tolerances(Stop(**KNOWN, tolerance=OFF())) == ()


def test_the_approach_speed_says_where_it_is_from():
    stated, given, norm = approach_speed(1.6), approach_speed(1.5), approach_speed(None)
    assert (stated.value, stated.unit, stated.origin) == (1.6, "m/s", Origin.STATED)
    assert "ISO/TS 15066:2016 5.5.4.2.3" in stated.source
    assert (given.value, given.unit, given.origin) == (1.5, "m/s", Origin.GIVEN)
    assert (norm.value, norm.origin) == ("1.6 m/s, 2 m/s up to S_p = 0.5 m", Origin.STATED)
    assert [intrusion(C).origin for C in (None, 0.0, 0.2)] == [Origin.MISSING, Origin.GIVEN, Origin.GIVEN]


# -- with an acceleration while it reacts ---------------------------------------------------------


def needed(options, v, a):
    """S_p of each part at speeds [m/s] and an acceleration [m/s²]."""
    onset, deceleration = accelerated(v, T_R, a, np.zeros(0)), options.get("deceleration")
    T_s = options.get("stopping") if deceleration is None else float(onset.v_s.max()) / deceleration
    return separation_distance(braking(onset, T_s, 0.5 if options.get("model") else 1.0), V_H, T_R, K)


@pytest.mark.parametrize("options", [KNOWN, HALF, BRAKING])
@pytest.mark.parametrize("v", [(1.0, 2.5), (0.7, 0.4), (0.0, 0.0)])
@pytest.mark.parametrize("a", [0.5, 3.0])
def test_at_the_largest_speed_with_an_acceleration_the_worst_part_is_as_near_as_it_may_be(options, v, a):
    v, inverse = np.array(v), bind_stop(Stop(**{**options, "acceleration": a}), None, None, None).inverse
    speed, factor = inverse(*onsets(v, a), D, V_H, K)
    if factor is None:
        # At rest each part may be the fastest.
        room = (D - needed(options, np.full(2, speed), a)).min()
    else:
        room = (D - needed(options, factor * v, a)).min()
        assert speed == pytest.approx(factor * v.max())
    assert room == pytest.approx(0, abs=1e-9) if speed > 0 else room <= 1e-9


@pytest.mark.parametrize("seed", range(3))
def test_what_is_worse_never_needs_less(seed):
    rng = np.random.default_rng(seed)
    for _ in range(200):
        v, a, T_r, T_s, v_h, dec, share = rng.uniform(0.01, 3, 7)
        share = 0.5 + 0.5 * (share > 1.5)

        def S_p(v=v, a=a, T_r=T_r, T_s=T_s, v_h=v_h, dec=dec, by_time=True, share=share):
            onset = accelerated(np.array([v, v / 2]), T_r, a, np.zeros(0))
            time = T_s if by_time else float(onset.v_s.max()) / dec
            return separation_distance(braking(onset, time, share), v_h, T_r, K)

        for by_time in (True, False):
            now = S_p(by_time=by_time)
            more = {"v": v, "a": a, "T_r": T_r, "v_h": v_h, **({"T_s": T_s} if by_time else {})}
            worse = [S_p(by_time=by_time, **{key: x + rng.uniform(0, 1)}) for key, x in more.items()]
            worse += [] if by_time else [S_p(by_time=False, dec=dec * rng.uniform(0.1, 1))]
            assert all((found >= now - 1e-12).all() for found in worse)
