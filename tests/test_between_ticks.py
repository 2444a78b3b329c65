"""Between two ticks: what passes through something there is exceeded, and no bound is ever beaten."""

from __future__ import annotations

import numpy as np
import pytest

from made_cell import TWO_R, made, two_r
from seerob.snapshot import Verdict

STICK = (
    '[[tools]]\nname = "stick"\non = "arm/tip"\nmass = 0.1\n'
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
SOURCE = '[[sources]]\nkind = "csv"\nrobot = "arm"\nfile = "motion.csv"\n'


def rows(motion, times):
    lines = ["t [s],j1 [rad],j2 [rad],qd_j1 [rad/s],qd_j2 [rad/s]"]
    for t in times:
        q, qd = motion(t)
        lines.append(",".join(f"{x:.12g}" for x in (t, *q, *qd)))
    return "\n".join(lines) + "\n"


def swing(speed):
    """Both links in line, turning at a speed [rad/s]."""
    return lambda t: ((speed * t, 0.0), (speed, 0.0))


def passing(folder, criterion, thing, *, physics="true", tick=0.01, at=0.195, rate=125, speed=1.45):
    """A tool that passes a thing at 3 m/s at an instant between two ticks."""
    angle = speed * at
    placed = thing.format(x=2.08 * np.cos(angle), y=2.08 * np.sin(angle))
    engine = f"engine = {{ gravity = [0, 0, 0], physics = {physics}, tick = {tick} }}\n"
    times = np.arange(0, 0.4 + 1e-9, 1 / rate).tolist()
    files = {"arm.urdf": two_r(), "motion.csv": rows(swing(speed), times)}
    return made(folder, engine + TWO_R + STICK + placed + SOURCE + criterion, files)


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


@pytest.mark.parametrize("physics", ["true", "false"])
@pytest.mark.parametrize("what", THROUGH)
def test_what_is_passed_between_two_ticks_is_exceeded(tmp_path, what, physics):
    thing, criterion = THROUGH[what]
    station = passing(tmp_path, criterion, thing, physics=physics)
    summary = station.run()
    assert summary.results["c"].verdict is Verdict.EXCEEDED
    assert summary.verdict is Verdict.EXCEEDED
