"""Where a motion comes from is said as it is: measured by a device, stated by a file, or made up."""

import pytest

import seerob as sr
from seerob.core.snapshot import Origin
from seerob.outputs.report.report import setup

PERSON = """
[[humans]]
name = "op"
stature = 1.75
mass = 75
sex = "male"

[[ergonomics]]
kind = "rula"
human = "op"
"""


def source(kind, more=""):
    return f'\n[[sources]]\nkind = "{kind}"\nhuman = "op"\n{more}'


@pytest.mark.parametrize(
    ("sources", "told"),
    [
        ([source("headset")], [("captured, live", Origin.MEASURED)]),
        ([source("bvh", 'file = "walk.bvh"\nunit = "cm"\n')], [("captured, from a file", Origin.STATED)]),
        ([source("joint_angles", 'file = "ik.mot"\n')], [("captured, from a file", Origin.STATED)]),
        ([source("keyframes", 'file = "library:reach"\n')], [(None, Origin.GIVEN)]),
        (
            [source("headset"), source("kinect", 'host = "192.0.2.1"\n')],
            [("captured, live", Origin.MEASURED)] * 2,
        ),
    ],
    ids=["live", "file", "angles", "made up", "two devices"],
)
def test_a_captured_motion_is_not_given_by_the_user(tmp_path, sources, told):
    file = tmp_path / "workstation.toml"
    file.write_text("".join([PERSON, *sources]))
    station = sr.load(tmp_path)
    basis = station.bound[0].basis
    found = [(i.value, i.origin, i.source) for i in basis.inputs if i.name == "motion of op"]
    assert [(value, origin) for value, origin, _ in found] == told
    assert [name for *_, name in found] == [s.name for s in station.workstation.sources]
    lines = setup({"workstation.toml": file.read_bytes()}).sources
    assert ["captured" in line[3] for line in lines] == [value is not None for value, _ in told]
