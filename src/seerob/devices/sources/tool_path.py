"""A path of the tool, poses over time without joints: workbooks, delimited text, controllers' logs.

The joints follow by inverse kinematics in the engine. Of all the joint positions that bring the tool to a
pose it takes those nearest to where the robot is, which need not be the controller's choice.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from seerob.core.errors import InputError, Problem, suggestion
from seerob.core.motion_origin import MotionOrigin, origin_finding
from seerob.core.snapshot import Finding
from seerob.core.transforms import Array
from seerob.devices.motion_files import PoseFrame, fixed_links
from seerob.files.tables.mapping import Mapping
from seerob.files.tables.motion import read_tool_motion
from seerob.files.trajectories.checks import sampling_findings
from seerob.files.trajectories.tool_trajectory import PoseSamples, ToolTrajectory, plausible
from seerob.workstation.source import Opened, Source, Target

FARTHEST = 30.0
"""A pose farther than this from the robot's base is a wrong unit or frame [m]."""
SAME = 1e-9
"""Frames that differ by less are the same [m or rad]."""


class ToolPath(Source, frozen=True, kw_only=True):
    """A robot's tool on a path in space, from a workbook or a text file with one pose per row."""

    robot: str
    """The robot it drives."""
    file: str
    """Path, from the folder of the workstation file."""
    frame: PoseFrame
    """``base`` or ``world``: what the poses are relative to; no file says it."""
    at: str | None = None
    """Full name of the link or tool whose pose the file has (``ur10/tool0``); the robot's tool point
    when not given."""
    base: str | None = None
    """Full name of the link that ``frame = "base"`` means (``ur10/base``); the root link when not given."""
    mapping: Mapping = Mapping()
    """Which column is what; guessed where it says nothing, and asked when in doubt."""
    origin: MotionOrigin = MotionOrigin.SIMULATOR
    """What the motion is a motion of; the joints are solved here in any case."""

    def target(self) -> str:
        """The robot."""
        return self.robot

    def open(self, folder: Path, target: Target | None) -> Opened:
        """Read the file and bring its poses into the world.

        Raises:
            InputError: The file is missing, wrong, ambiguous, or no tool could move so; or a name in the
                source's table is not there.
        """
        if target is None:
            raise InputError.at(
                self.file, "robot", f"no robot {self.robot!r}", "name a robot of the workstation"
            )
        self._check_at(target)
        world_from_frame, where = self._frame(target)
        read, used, remarks = read_tool_motion(
            folder / self.file, self.mapping, name=self.file, target=target
        )
        plausible(read)
        path = read.seen_from(world_from_frame)
        self._check_distance(path, target)
        shown = " · ".join(used.mapping.toml().splitlines()[1:])
        texts = (
            f"columns of {self.file}: {shown}",
            *(f"{self.file}: {remark}" for remark in remarks),
            f"poses of {self.at or f'the tool point of {target.name}'} in {where}; the tool moves at up to "
            f"{path.speeds().max():.3g} m/s",
        )
        text = (
            f"joint positions are solved from the tool poses of {self.file}: the branch (the one nearest to "
            f"q of {target.name}), and what a redundant robot does beside its tool, are chosen by seerob "
            "and may differ from the controller's; joint speeds are not checked; what depends on them is "
            "preliminary"
        )
        return Opened(
            samples=PoseSamples(path, self.name or f"tool_path {target.name}", self.at or target.name),
            duration=path.duration,
            began=float(path.t[0]),
            findings=(
                origin_finding(self.origin, target.name, self.file),
                Finding(level="assumed", subject=target.name, text=text),
                *(Finding(level="note", subject=target.name, text=text) for text in texts),
                *sampling_findings(path, target.name, self.timeout),
            ),
        )

    def _check_at(self, target: Target) -> None:
        if self.at is None or self.at == target.name or not target.frames or self.at in target.frames:
            return
        what = f"no link or tool {self.at!r} that {target.name} moves"
        raise InputError.at(self.file, "at", what, suggestion(self.at, target.frames))

    def _check_distance(self, path: ToolTrajectory, target: Target) -> None:
        if target.world_from_base is None:
            return
        away = np.linalg.norm(path.position - np.array(target.world_from_base)[:3, 3], axis=1)
        far = np.flatnonzero(away > FARTHEST)
        if far.size:
            i = int(far[0])
            what = f"a pose {away[i]:.4g} m away from the base of {target.name} ({far.size} such rows)"
            raise InputError.at(self.file, path.place(i), what, "correct tcp_position_unit or frame")

    def _frame(self, target: Target) -> tuple[Array, str]:
        """World from the frame of the poses (4, 4), and the frame in words."""
        if self.frame is PoseFrame.WORLD:
            if self.base is not None:
                what, remedy = f'{self.base!r} beside frame = "world"', 'write frame = "base", or remove it'
                raise InputError.at(self.file, "base", what, remedy)
            return np.eye(4), "the world"
        if target.world_from_base is None:
            what = f"nobody says where {target.name} stands"
            raise InputError.at(self.file, "frame", what, 'use frame = "world"')
        world_from_base = np.array(target.world_from_base)
        fixed = fixed_links(target)
        if not fixed:
            return world_from_base, f"the base of {target.name}"
        root = next(iter(fixed))
        if self.base is not None:
            if self.base not in fixed:
                what = f"no link {self.base!r} that stands still with {target.name}"
                raise InputError.at(self.file, "base", what, suggestion(self.base, fixed))
            return world_from_base @ fixed[self.base], f"the frame of {self.base}"
        # Descriptions made after the ROS-Industrial convention have a link `base` where the controller has
        # its own base frame; the root may be turned against it, for Universal Robots by half a turn.
        other = f"{target.name}/base"
        if other in fixed and np.abs(fixed[other] - fixed[root]).max() > SAME:
            what = f'frame = "base" can be {root} or {other}, which is placed differently'
            remedy = f'write base = "{other}" (by convention the frame of the controller) or base = "{root}"'
            raise InputError(Problem(self.file, "base", what, remedy))
        return world_from_base @ fixed[root], f"the frame of {root}"
