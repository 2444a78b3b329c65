import numpy as np
import pytest
from made_motion import arrays, motion, target

from seerob.core.errors import InputError
from seerob.devices.sources.kuka_log import KukaLog

ROBOT = "LBR_iiwa_7_R800_1"


def write(path, *, delimiter=" ", robots=(ROBOT,), percent="% ", command=False):
    t, q, _ = motion(80, 0.005, 7)
    kinds = ["axisQMsr", *(["axisQCmdT1m"] if command else [])]
    header = ["ZeitInSec", "ZeitInNanoSec"]
    header += [f"{kind}_{robot}[{i}]" for kind in kinds for robot in robots for i in range(7)]
    lines = [percent + delimiter.join(header)]
    nanoseconds = np.round(t * 1e9).astype(int) + 1_450_000_000_900_000_000
    for k, ns in enumerate(nanoseconds.tolist()):
        blocks = [np.degrees(q[k]) + i + 10 * j for j in range(len(kinds)) for i in range(len(robots))]
        cells = [str(ns // 10**9), str(ns % 10**9), *(repr(x) for x in np.concatenate(blocks).tolist())]
        lines.append(delimiter.join(cells))
    path.write_text("\n".join(lines) + "\n")
    return t, q


@pytest.mark.parametrize("delimiter", [" ", "\t", ","])
@pytest.mark.parametrize("percent", ["% ", "%", ""])
def test_a_log_is_read_in_degrees_with_nanoseconds_kept(tmp_path, delimiter, percent):
    t, q = write(tmp_path / "a.log", delimiter=delimiter, percent=percent)
    opened = KukaLog(robot="iiwa", file="a.log").open(tmp_path, target(7, name="iiwa"))
    heard = arrays(opened)
    np.testing.assert_allclose(heard[0], t, rtol=0, atol=1e-15 + 1e-9 / 1e3)
    np.testing.assert_allclose(heard[1], q, rtol=0, atol=1e-15)
    assert any("in deg (the file does not say)" in f.text and f.level == "assumed" for f in opened.findings)


def test_several_robots_and_kinds_are_told_apart(tmp_path):
    _, q = write(tmp_path / "a.log", robots=("left", "right"), command=True)

    def read(**options):
        return arrays(KukaLog(robot="iiwa", file="a.log", **options).open(tmp_path, target(7, name="iiwa")))[
            1
        ]

    with pytest.raises(InputError, match=r"2 sets of joints: left .*right"):
        read()
    with pytest.raises(InputError, match="no robot 'middle'"):
        read(recorded_robot="middle")
    np.testing.assert_allclose(np.degrees(read(recorded_robot="right") - q), 1, atol=1e-12)
    commanded = read(recorded_robot="left", joints="commanded")
    np.testing.assert_allclose(np.degrees(commanded - q), 10, atol=1e-12)


def test_degrees_taken_for_radians_meet_the_limits(tmp_path):
    write(tmp_path / "a.log")
    with pytest.raises(InputError, match="its limit"):
        KukaLog(robot="iiwa", file="a.log", joint_unit="rad").open(tmp_path, target(7, name="iiwa"))


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("% Zeit x\n1 2\n", "no column 'ZeitInSec'"),
        ("% ZeitInSec axisQMsr_a[0]\n1 2\n", "no column 'ZeitInNanoSec'"),
        ("% ZeitInSec ZeitInNanoSec force\n1 2 3\n", "no column 'axisQMsr"),
        ("% ZeitInSec ZeitInNanoSec axisQCmd_a[0]\n1 2 3\n", 'joints = "commanded"'),
        ("% ZeitInSec ZeitInNanoSec axisQMsr_a[1]\n1 2 3\n", "joints [1] of a"),
        ("% ZeitInSec ZeitInNanoSec axisQMsr_a[0]\n1 2 3\n1 3\n", "row 3 column 'axisQMsr_a[0]': is empty"),
    ],
)
def test_other_and_damaged_files_are_refused(tmp_path, text, word):
    (tmp_path / "a.log").write_text(text)
    with pytest.raises(InputError) as error:
        KukaLog(robot="iiwa", file="a.log").open(tmp_path, target(1, name="iiwa"))
    assert word in str(error.value)
