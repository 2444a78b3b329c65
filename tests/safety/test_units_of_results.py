"""Every figure of a planar arm before a person has the unit that its name promises."""

from __future__ import annotations

from made_cell import FLOATING, TWO_R, made, results_at, two_r
from seerob.core.plugin import load
from seerob.criteria.criterion import Criterion

CELL = """
[[humans]]
name = "op"
stature = 1.75
mass = 75
sex = "male"
at = { position = [4, 0, -1] }
[[areas]]
name = "zone"
shape = { box = [1, 1, 1] }
[[sensors]]
name = "mat"
response = 0.1
at = { position = [0, 0, 0] }
pressure_mat = { corners = [[-0.9, -0.9], [0.9, -0.9], [0.9, 0.9], [-0.9, 0.9]] }
"""
ASKED = {
    "effective_mass": 'at = "arm"',
    "force_polytope": 'at = "arm"',
    "kinetic_energy": 'robot = "arm"',
    "manipulability": 'at = "arm"',
    "minimum_distance": 'between = ["arm", "op"]',
    "safety_area": 'area = "zone"\nof = "arm"',
    "pressure_mat": 'sensor = "mat"\nof = "arm"',
    "device_distance": 'sensor = "mat"\nhazard = "arm"\nstopping = 0.2\nedition = "2010"\nreach_under = 0',
    "swept_volume": 'of = "arm"\nvoxel = 0.1',
    "velocity": 'at = "arm"',
    "separation": 'between = ["arm", "op"]\nstop = { acceleration = 0, reaction = 0.1, stopping = 0.3 }\n'
    "intrusion = 0.2\n"
    "human_uncertainty = 0\nrobot_uncertainty = 0",
}
UNITS = {
    "effective_mass": {"": "kg", "m1": "kg", "m2": "kg", "m3": "kg", "M/2 + m_L": "kg"},
    "force_polytope": {
        "": "N", "in every direction": "N", "across that direction": "N",
        "direction x": "", "direction y": "", "direction z": "",
    },
    "kinetic_energy": {"": "J"},
    "manipulability": {"": "m/rad", "σ₁": "m/rad", "σ₂": "m/rad", "√det J_v J_vᵀ": "m³/rad³"},
    "minimum_distance": {"": "m"},
    "safety_area": {"": "m", "arm/l1": "m"},
    "pressure_mat": {
        "": "m", "arm/l1": "m", "walked before detection": "m", "walked until the output switched": "m",
    },
    "device_distance": {"": "m"},
    "swept_volume": {"": "m³", "dilation for motion": "m"},
    "velocity": {"": "m/s"},
    "separation": {
        "": "m", **dict.fromkeys(("S_h", "S_r", "S_s", "C", "Z_d", "Z_r", "arm/l1", "arm/l2"), "m"),
        "largest permissible speed": "m/s", "share of the present speed": "",
    },
}  # fmt: skip


def test_units(tmp_path):
    criteria = "".join(
        f'[[safety]]\nkind = "{kind}"\nname = "{kind}"\n{options}\n' for kind, options in ASKED.items()
    )
    station = made(tmp_path, FLOATING + TWO_R + CELL + criteria, {"arm.urdf": two_r()})
    found = results_at(station, arm=((0.0, 0.0), (1.0, 0.5)))
    assert {
        kind: {"": result.unit, **{part.name: part.unit for part in result.parts}}
        for kind, result in found.items()
    } == UNITS
    for kind, result in found.items():
        assert result.at_most is load("safety", kind, Criterion).at_most, kind
