"""An arm, a person and speed and separation monitoring between them; its stops, and its terms."""

from __future__ import annotations

import numpy as np

from made_cell import FLOATING, TWO_R, made, results_at, two_r

PERSON = (
    '[[humans]]\nname = "op"\nstature = 1.75\nmass = 75\nsex = "male"\nat = {{ position = [{x}, 0, -1] }}\n'
)
KNOWN = "intrusion = 0.2\nhuman_uncertainty = 0.1\nrobot_uncertainty = 0.05\n"
K = 0.35
BOUND = "acceleration = 0, reaction = 0.1, stopping = 0.3"
HALF = f'{BOUND}, model = "constant_deceleration"'
BRAKING = 'acceleration = 0, reaction = 0.1, deceleration = 2.0, model = "constant_deceleration"'
SIMULATED = 'acceleration = 0, reaction = 0.1, model = "simulated", brakes = [40.0, 20.0]'
ROTOR = "rotor_inertia = [0.0, 0.0]\n"
JOINT = "{{ joint = {j}, full_speed = 3.0, way = [[[{way}]]], time = [[[{time}]]] }}"
HEAD = 'robot = "arm", category = 0, source = "s", confidence = "1S"'
TABLE = (
    f'acceleration = 0, reaction = 0.1, model = "table", table = {{ {HEAD}, rated_payload = 5.0, joints = ['
    + JOINT.format(j=0, way=0.4, time=0.3)
    + ", "
    + JOINT.format(j=1, way=0.2, time=0.1)
    + "] }"
)


def station(folder, stop, options=KNOWN, *, x=6.0, arm=ROTOR, more="", person="", urdf=None):
    """The arm, and a person ``x`` metres away [m]; ``person``: more lines of its entry."""
    text = FLOATING + TWO_R + arm + more + PERSON.format(x=x).replace("at =", f"{person}at =")
    text += f'[[safety]]\nkind = "separation"\nname = "S"\nbetween = ["arm", "op"]\nstop = {{ {stop} }}\n'
    return made(folder, text + options, {"arm.urdf": urdf or two_r()})


def separation(folder, stop, options=KNOWN, *, q=(0.0, 0.0), qd=(1.0, 0.0), **more):
    """What is said of the arm at (q, qd)."""
    return results_at(station(folder, stop, options, **more), arm=(q, qd))["S"]


def part(result, name):
    """One of the figures beside the result."""
    return next(p for p in result.parts if p.name == name)


def terms(result):
    """S_h, S_r, S_s, C, Z_d and Z_r [m]."""
    return [part(result, name).value for name in ("S_h", "S_r", "S_s", "C", "Z_d", "Z_r")]


V = np.hypot(2, 0.05)
"""Speed of the arm's fastest corner at 1 rad/s."""
