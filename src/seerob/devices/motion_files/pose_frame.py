"""What poses of a tool are relative to, and where that is on its robot."""

from __future__ import annotations

from enum import StrEnum

import numpy as np

from seerob.core.transforms import Array
from seerob.workstation.source import Target


class PoseFrame(StrEnum):
    """What the poses of a file are relative to."""

    BASE = "base"
    """The robot's base, as controllers log them."""
    WORLD = "world"
    """The workstation."""


def fixed_links(target: Target) -> dict[str, Array]:
    """Links that the robot's joints do not move, root first: base from link, (4, 4), by full name."""
    found: dict[str, Array] = {}
    if target.description is None:
        return found
    for link in target.description.links:
        parent = None if link.parent is None else found.get(f"{target.name}/{link.parent}")
        if not link.joints and (link.parent is None or parent is not None):
            above = np.eye(4) if parent is None else parent
            found[f"{target.name}/{link.name}"] = above @ link.parent_from_link
    return found
