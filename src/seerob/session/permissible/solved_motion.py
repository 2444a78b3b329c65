"""A path of the tool as joint positions: inverse kinematics from pose to pose, as the twin solves it."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np

from seerob.core.errors import InputError
from seerob.core.samples import JointSample, PoseSample, Quality
from seerob.core.transforms import rotation_from_wxyz
from seerob.model.model import Mechanism, Model
from seerob.twin.control.inverse_kinematics import solve_pose
from seerob.twin.engine import POSE_TOLERANCE


def solved(model: Model, robot: Mechanism, samples: Sequence[PoseSample]) -> list[JointSample]:
    """Joint positions for poses, each from those before it; the branch is the nearest, as in the engine.

    Args:
        model: The compiled workstation.
        robot: Who is to bring the tool there.
        samples: In the order of time.

    Raises:
        InputError: A pose that is not finite, or out of reach.
    """
    data = mujoco.MjData(model.mj)
    q = robot.home
    out: list[JointSample] = []
    for sample in samples:
        position, wxyz = np.array(sample.position), np.array(sample.wxyz)
        if not (np.isfinite(position).all() and np.isfinite(wxyz).all()):
            what = f"a pose that is not finite at {sample.t:.3f} s"
            raise InputError.at("permissible speed", robot.name, what, "correct the source")
        frame = model.frame(sample.target)
        q, miss = solve_pose(
            model.mj, data, robot, frame, rotation_from_wxyz(wxyz), position, start=q
        )  # fmt: skip
        good = sample.quality is Quality.GOOD
        if miss.larger > POSE_TOLERANCE and good:
            what = f"the pose at {sample.t:.3f} s is out of reach: the nearest that was found is {miss}"
            raise InputError.at("permissible speed", robot.name, what, "move the path or the robot")
        out.append(
            JointSample(
                source=sample.source,
                target=robot.name,
                seq=sample.seq,
                t=sample.t,
                quality=sample.quality,
                q=tuple(q.tolist()),
            )
        )
    return out
