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


def test_a_source_is_told_whose_keys_have_units(tmp_path):
    """An option in degrees or milliseconds, of a source or the engine, made all of it unknown."""
    (tmp_path / "workstation.toml").write_text(
        PERSON
        + "\n[engine]\ntick_ms = 8\n"
        + source("keyframes", 'file = "library:reach"\ntimeout_ms = 350\nloop = true\n')
        + '\n[[sources]]\nkind = "waypoints"\nrobot = "arm"\njoint_speed_deg_s = 45\n'
        + "[[sources.points]]\nq_deg = [0, -90, 90, 0, 0, 0]\n"
    )
    told = setup({"workstation.toml": (tmp_path / "workstation.toml").read_bytes()})
    assert "every 0.008 s (125 Hz)" in dict(told.engine)["ticks"]
    person, arm = told.sources
    assert person[1:3] == ("op", "keyframes library:reach")
    assert person[4:] == ("0.35 s", "starts again after 1 s")
    assert arm[1] == "arm"
    assert arm[3].startswith("a planned path that nobody has executed")
    assert arm[4:] == ("0.2 s", "stops")


@pytest.mark.parametrize(
    ("more", "origin", "said"),
    [
        ("", Origin.CHOICE, "workstation file, 0.5 m when not given"),
        ("horizon = 0.8\n", Origin.GIVEN, "workstation file"),
    ],
)
def test_what_the_file_does_not_give_is_not_the_users(tmp_path, more, origin, said):
    (tmp_path / "workstation.toml").write_text(
        PERSON + '\n[[robots]]\nname = "arm"\nmodel = "library:ur5e"\n'
        '\n[[safety]]\nkind = "power_and_force"\nrobot = "arm"\nhuman = "op"\n' + more
    )
    inputs = sr.load(tmp_path).bound[0].basis.inputs
    assert [(i.origin, i.source) for i in inputs if i.name == "horizon"] == [(origin, said)]
