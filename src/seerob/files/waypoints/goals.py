"""Joint positions of waypoints: as given, or of the pose, on a branch that is named."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from seerob.core.errors import InputError
from seerob.core.transforms import Array, rotation_from_wxyz
from seerob.files.waypoints.arm import Arm
from seerob.files.waypoints.branches import Branch, branch, is_classic
from seerob.files.waypoints.inverse import solutions
from seerob.files.waypoints.unreachable import why_not
from seerob.files.waypoints.waypoint import Program, Waypoint


class Goals:
    """Goes through the waypoints in order.

    Args:
        program: Waypoints, poses in the arm's base.
        arm: The robot.
        start: Where it stands before the first one [rad or m].
        branch: Of poses that joint moves go to; nearest to where the robot is when not given.

    Raises:
        InputError: No start, or another number of joints than the robot has.
    """

    def __init__(
        self, program: Program, arm: Arm, *, start: tuple[float, ...] | None, branch: Branch | None
    ) -> None:
        self._program, self._arm, self._wanted = program, arm, branch
        self.remarks: list[str] = []
        self.doubts: list[str] = []
        self.found: list[Array] = []
        """Joint positions of each waypoint that was gone to."""
        head = program.waypoints[0]
        if start is None and head.q is None and (head.near is None or head.move.of_tool):
            what = (
                f"the first waypoint ({head.shown}) is a pose: its branch depends on where the robot stands"
            )
            raise InputError.at(program.file, "start", what, "give start, the joint positions [rad or m]")
        given = ((w.shown, q) for w in program.waypoints for q in (w.q, w.near))
        for where, q in (("start", start), *given):
            if q is not None and len(q) != arm.n:
                what = f"{len(q)} joint positions, the robot has {arm.n} joints"
                raise InputError.at(program.file, where, what, f"give {arm.n}")
        self._classic = is_classic(arm)
        stands = start or head.q or head.near
        self._here = np.array(stands, float)
        if start is None:
            if head.q is None:
                self._here = self._solved(head)
                self.remarks.clear()  # it is gone to again, as the first of the waypoints
            self.remarks.append(f"the motion begins in its first waypoint, {head.shown}")
        self.first: Array = self._here
        if arm.n > 6 and any(w.pose is not None or w.move.of_tool for w in program.waypoints):
            self.doubts.append(
                f"{arm.n} joints for a pose of 6: the joint positions are not determined; those nearest to "
                "where the robot is are taken, a controller may choose others"
            )

    def steps(self) -> Iterator[tuple[Array, Waypoint, Array]]:
        """Where the robot is, the next waypoint, and its joint positions (of a linear move its start's)."""
        for waypoint in self._program.waypoints:
            if waypoint.q is not None:
                q = np.array(waypoint.q, float)
            elif waypoint.move.of_tool:
                q = self._here
            else:
                q = self._solved(waypoint)
            before, self._here = self._here, q
            yield before, waypoint, q
            self.found.append(self._here)

    def reached(self, q: Array) -> None:
        """Where the way to the waypoint ended."""
        waypoint = self._program.waypoints[len(self.found)]
        if waypoint.move.of_tool and waypoint.q is not None and np.abs(q - self._here).max() > 1e-3:
            self.doubts.append(
                f"{waypoint.shown}: the straight way ends in other joint positions than it has "
                f"(off by {np.abs(q - self._here).max():.3g} rad or m): the tool is there, on another branch"
            )
        if waypoint.move.of_tool and waypoint.pose is not None:
            self._name(waypoint, q)
        self._here = q

    def _solved(self, waypoint: Waypoint) -> Array:
        pose = waypoint.pose
        assert pose is not None
        rotation, position = rotation_from_wxyz(pose.wxyz), np.array(pose.position)
        near = self._here if waypoint.near is None else np.array(waypoint.near, float)
        ways = solutions(self._arm, rotation, position, near)
        if not ways:
            what = why_not(self._arm, rotation, position, near)
            remedy = "is the base or the tool point another one?"
            raise InputError.at(self._program.file, waypoint.shown, what, remedy)
        fitting = [w for w in ways if self._wanted in (None, w.branch)]
        if not fitting:
            there = "; ".join(str(w.branch) for w in ways)
            what = f"the pose is not reached on the branch {self._wanted}"
            raise InputError.at(self._program.file, waypoint.shown, what, f"it is on: {there}")
        chosen = fitting[0]
        others = f", one of {len(ways)} found" if self._arm.n == 6 else ""
        nearest = "nearest to " + ("where the robot is" if waypoint.near is None else "qnear")
        if chosen.branch is not None:
            why = nearest if self._wanted is None else "as the source says"
            self.remarks.append(f"{waypoint.shown}: branch {chosen.branch} ({why}{others})")
        elif self._arm.n <= 6:
            self.remarks.append(f"{waypoint.shown}: solution {nearest}{others}")
        return chosen.q

    def _name(self, waypoint: Waypoint, q: Array) -> None:
        if self._classic:
            self.remarks.append(f"{waypoint.shown}: branch {branch(self._arm.posture(q))} (kept on the way)")
