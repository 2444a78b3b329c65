"""KUKA Sunrise: logs of its DataRecorder (``.log``), columns in degrees.

The header line starts with ``%``; time is split into ``ZeitInSec`` and ``ZeitInNanoSec``; joints are
``axisQMsr_<robot>[0…]`` (measured) and ``axisQCmd…_<robot>[0…]`` (commanded). The unit stands nowhere in
the file: that it is the degree is what those who publish such logs convert from.
"""

from __future__ import annotations

import re
from math import pi
from pathlib import Path

from seerob.core.errors import InputError
from seerob.core.motion_origin import MotionOrigin
from seerob.core.snapshot import Finding
from seerob.devices.motion_files import Joints, Log, TrajectoryFile, missing, notes, open_log
from seerob.files.tables.mapping import AngleUnit
from seerob.files.trajectories.trajectory import Trajectory
from seerob.workstation.source import Target

JOINT = re.compile(r"(axisQ(?:Msr|Cmd\w*?))_(.+)\[(\d{1,2})\]")


class KukaLog(TrajectoryFile, frozen=True, kw_only=True):
    """A KUKA LBR's joint motion as its controller's DataRecorder logged it."""

    origin: MotionOrigin = MotionOrigin.CONTROLLER
    joints: Joints = Joints.MEASURED
    """``commanded`` takes ``axisQCmd…`` instead of ``axisQMsr``."""
    joint_unit: AngleUnit = AngleUnit.DEG
    """The DataRecorder writes degrees; ``rad`` for a file that was converted since."""
    recorded_robot: str | None = None
    """The robot's name in the file, such as ``LBR_iiwa_7_R800_1``; needed when it holds several."""

    def read(self, path: Path, target: Target) -> tuple[Trajectory, tuple[Finding, ...]]:
        """Read time and joints."""
        log = open_log(path, self.file, "ZeitInSec", " ,;\t", "a Sunrise DataRecorder log", comment="%")
        error = missing(log, ["ZeitInNanoSec"], "record the time with both columns")
        if error is not None:
            raise error
        columns, kind, robot = self._joint_columns(log)
        values = log.read(["ZeitInSec", "ZeitInNanoSec", *columns])
        seconds = values.column("ZeitInSec")
        # From the first second on, so that nanoseconds are not lost in the digits of an epoch.
        t = (seconds - seconds[:1]) + 1e-9 * values.column("ZeitInNanoSec")
        factor = pi / 180 if self.joint_unit is AngleUnit.DEG else 1.0
        trajectory = Trajectory(file=self.file, t=t, q=values.table(columns) * factor, rows=values.rows)
        unit = f"taken to be in {self.joint_unit} (the file does not say)"
        said = f"{self.file}: joints are {kind} of {robot}, {unit}"
        return trajectory, notes((said,), target.name, level="assumed")

    def _joint_columns(self, log: Log) -> tuple[list[str], str, str]:
        found: dict[tuple[str, str], dict[int, str]] = {}
        for name in log.names:
            match = JOINT.fullmatch(name)
            if match is not None:
                found.setdefault((match[1], match[2]), {})[int(match[3])] = name
        wanted = "axisQMsr" if self.joints is Joints.MEASURED else "axisQCmd"
        where = f"row {log.header_row}"
        kinds = [key for key in found if key[0].startswith(wanted)]
        if not kinds:
            other = "commanded" if self.joints is Joints.MEASURED else "measured"
            remedy = f'set joints = "{other}"' if found else "record the joint positions"
            raise InputError.at(self.file, where, f"no column '{wanted}…_<robot>[0]'", remedy)
        chosen = [key for key in kinds if self.recorded_robot in (None, key[1])]
        if len(chosen) != 1:
            names = ", ".join(sorted({f"{robot} ({kind})" for kind, robot in kinds}))
            what = f"{len(kinds)} sets of joints: {names}" if chosen else f"no robot {self.recorded_robot!r}"
            raise InputError.at(self.file, "recorded_robot", what, f"name one of: {names}")
        columns = found[chosen[0]]
        if set(columns) != set(range(len(columns))):
            what = f"joints {sorted(columns)} of {chosen[0][1]}"
            raise InputError.at(self.file, where, what, "record every joint from 0 on")
        return [columns[i] for i in range(len(columns))], *chosen[0]
