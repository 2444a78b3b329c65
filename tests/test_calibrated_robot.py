"""The kinematics of a very robot on the whole way: heard, compared, written, used, and in the recording."""

from __future__ import annotations

import numpy as np
import pytest

from made_cell import made
from seerob.app.cli import main
from seerob.app.emulation.motions import swing
from seerob.app.emulators.rtde import RtdeServer
from seerob.core.errors import InputError
from seerob.protocols.robots.ur_primary import Kinematics

ALPHA = (np.pi / 2, 0.0, 0.0, np.pi / 2, -np.pi / 2, 0.0)
TYPE = Kinematics(
    (0.0,) * 6, (0.0, -0.612, -0.5723, 0.0, 0.0, 0.0), (0.1273, 0.0, 0.0, 0.163941, 0.1157, 0.0922), ALPHA
)
VERY = Kinematics((0.0, 3e-3, -2e-3, 0.0, 0.0, 0.0), (0.0, -0.6135, -0.571, 0.0, 0.0, 0.0), TYPE.d, ALPHA)
MOTION = swing((0.0, -1.2, 1.4, -1.5, -1.5, 0.0))


def cell(folder, server, *, model="ur10", calibration=""):
    port = server.primary_port if server.kinematics is not None else 1
    return made(
        folder,
        f'[[robots]]\nname = "arm"\nmodel = "library:{model}"\n{calibration}'
        '[[sources]]\nkind = "rtde"\nrobot = "arm"\nhost = "127.0.0.1"\n'
        f"port = {server.port}\nprimary_port = {port}\n",
    )


def said(station):
    station.reach()
    return {
        f.level: f.text for f in station.scene().findings if "tool is" in f.text or "kinematics" in f.text
    }


def test_what_is_off_is_written_used_and_then_right(tmp_path, capsys):
    with RtdeServer(MOTION, kinematics=VERY) as server:
        assert "the model's tool is up to" in said(cell(tmp_path, server))["warning"]
        address = ["127.0.0.1", "--port", str(server.port), "--seconds", "0.2"]
        options = [
            "--set",
            f"primary_port={server.primary_port}",
            "--calibration",
            str(tmp_path / "very.toml"),
        ]
        assert main(["probe", "rtde", *address, *options]) == 0
        assert 'calibration = "very.toml"' in capsys.readouterr().out
        station = cell(tmp_path, server, calibration='calibration = "very.toml"\n')
        found = said(station)
        assert "warning" not in found
        texts = [f.text for f in station.scene().findings]
        assert any("the model's tool is where this very robot's is, to 0.0" in text for text in texts)
        assert any("kinematics of this very robot (very.toml" in text for text in texts)
        assert station.files["very.toml"] == (tmp_path / "very.toml").read_bytes()
        with pytest.raises(InputError, match="not of this type"):
            cell(tmp_path, server, model="ur5", calibration='calibration = "very.toml"\n')


def test_that_of_the_type_and_none_are_said(tmp_path):
    with RtdeServer(MOTION, kinematics=TYPE) as server:
        assert "the model's tool is where" in said(cell(tmp_path, server))["note"]
        other = cell(tmp_path, server, model="ur5")
        assert "not of this type of robot" in said(other)["warning"]
        assert ("arm",) in {f.holds for f in other.scene().findings if "its kinematics" in f.text}
    with RtdeServer(MOTION) as server:
        assert "could not be read (port 1: Connection refused)" in said(cell(tmp_path, server))["assumed"]


def test_a_calibration_that_is_not_there_is_an_error(tmp_path):
    text = '[[robots]]\nname = "arm"\nmodel = "library:ur10"\ncalibration = "gone.toml"\n'
    with pytest.raises(InputError, match=r"gone\.toml"):
        made(tmp_path, text)
