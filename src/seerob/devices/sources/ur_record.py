"""Universal Robots: logs through RTDE, by UR's own ``record.py`` (blanks) or by ur_rtde (commas).

Both write one column per field, vectors as ``actual_q_0 … actual_q_5``; units are RTDE's: s, rad,
rad/s, N·m.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from seerob.core.errors import InputError
from seerob.core.motion_origin import MotionOrigin
from seerob.core.snapshot import Finding
from seerob.devices.motion_files import Joints, Log, LogValues, TrajectoryFile, notes, open_log
from seerob.files.trajectories.trajectory import Trajectory
from seerob.workstation.source import Target

PREFIX = {Joints.MEASURED: "actual", Joints.COMMANDED: "target"}

POWER_OFF = 3
"""Robot modes up to this one (NO_CONTROLLER … POWER_OFF) have no live encoders."""
RUNNING = 7

STOPS = {3: "protective stop", 5: "safeguard stop", 6: "emergency stop", 7: "emergency stop", 8: "violation",
         9: "fault"}  # fmt: skip
"""Safety status or mode → what it means for a motion that is to be judged."""


class UrRecord(TrajectoryFile, frozen=True, kw_only=True):
    """A Universal Robots' joint motion as its controller logged it through RTDE."""

    origin: MotionOrigin = MotionOrigin.CONTROLLER
    """``vendor_emulator`` when it was logged from URSim."""
    joints: Joints = Joints.MEASURED
    """``commanded`` takes ``target_q`` instead of ``actual_q``."""

    def read(self, path: Path, target: Target) -> tuple[Trajectory, tuple[Finding, ...]]:
        """Read time, joints, velocities and, where there is one, the torque."""
        log = open_log(path, self.file, "timestamp", " ,;", "a recording of RTDE")
        prefix = PREFIX[self.joints]
        q = _vector(log, f"{prefix}_q")
        if not q:
            other = next(j for j in Joints if j is not self.joints)
            has = bool(_vector(log, f"{PREFIX[other]}_q"))
            remedy = f'set joints = "{other}"' if has else f"record {prefix}_q"
            raise InputError.at(self.file, f"row {log.header_row}", f"no column '{prefix}_q_0'", remedy)
        qd = _vector(log, f"{prefix}_qd")
        # Currents count where torques are not said; their factors to torques are not published.
        tau = _vector(log, "actual_current_as_torque")
        current = [] if tau else _vector(log, "actual_current")
        # The rotation vector behind it tells nothing that the joints do not.
        tcp, speed = (_vector(log, f"{prefix}_TCP_{what}")[:3] for what in ("pose", "speed"))
        payload = [c for c in ("payload",) if c in log.names]
        status: list[str] = [c for c in ("robot_mode", "safety_status", "safety_mode") if c in log.names]
        values = log.read(["timestamp", *q, *qd, *tau, *current, *tcp, *speed, *payload, *status])
        invalid, warnings = _status(values, status)
        trajectory = Trajectory(
            file=self.file,
            t=values.column("timestamp"),
            q=values.table(q),
            qd=values.table(qd) if len(qd) == len(q) else None,
            tau=values.table(tau) if len(tau) == len(q) else None,
            current=values.table(current) if len(current) == len(q) else None,
            tcp_position=values.table(tcp) if tcp else None,
            tcp_speed=np.linalg.norm(values.table(speed), axis=1) if speed else None,
            payload=values.column("payload") if payload else None,
            tcp_in_base=True,
            invalid=invalid,
            rows=values.rows,
        )
        said = f"{self.file}: joints are {prefix}_q"
        return trajectory, notes((said,), target.name) + notes(warnings, target.name, level="warning")


def _vector(log: Log, field: str) -> list[str]:
    """Columns of a vector field in order; empty when it is not there or not whole."""
    found = {int(m[1]): n for n in log.names if (m := re.fullmatch(rf"{field}_(\d{{1,2}})", n))}
    return [found[i] for i in range(len(found))] if set(found) == set(range(len(found))) else []


def _status(values: LogValues, columns: list[str]) -> tuple[NDArray[np.bool_] | None, tuple[str, ...]]:
    """Rows in which the robot was off, and remarks on stops."""
    invalid, remarks = None, []
    t = values.column("timestamp")
    if "robot_mode" in columns:
        mode = values.column("robot_mode")
        off = mode <= POWER_OFF
        if off.any():
            invalid = off
            remarks.append(f"robot off in {int(off.sum())} of {len(off)} rows, first at {_at(t, off)}")
        idle = ~off & (mode != RUNNING)
        if idle.any():
            remarks.append(
                f"robot not running in {int(idle.sum())} of {len(off)} rows, first at {_at(t, idle)}"
            )
    for column in columns:
        if column == "robot_mode":
            continue
        for code, name in STOPS.items():
            hit = values.column(column) == code
            if hit.any():
                remarks.append(f"{name} ({column} {code}) in {int(hit.sum())} rows, first at {_at(t, hit)}")
    return invalid, tuple(f"{values.file}: {r}" for r in remarks)


def _at(t: NDArray[np.float64], hit: NDArray[np.bool_]) -> str:
    return f"{t[int(np.argmax(hit))] - t[0]:.3f} s"
