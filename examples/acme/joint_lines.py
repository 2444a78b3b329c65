"""Source of a company: joint positions in a text file, one JSON object per line."""

from __future__ import annotations

import json
import math
from pathlib import Path

from seerob.api import InputError, JointSample, Opened, Source, Target


class JointLines(Source, frozen=True, kw_only=True):
    """A robot's motion from lines like ``{"t": 0.01, "q": [0, -1.57]}``, in seconds and radians."""

    robot: str
    """The robot it drives."""
    file: str
    """Path, from the folder of the workstation file."""

    def target(self) -> str:
        """Name the robot: who is driven is checked before anything is read."""
        return self.robot

    def open(self, folder: Path, target: Target | None) -> Opened:
        """Read the whole file; a recorded source knows its future.

        Raises:
            InputError: The file is missing or a line of it is wrong.
        """
        if target is None:
            raise InputError.at(self.file, "robot", f"no robot {self.robot!r}", "name one of [[robots]]")
        try:
            with (folder / self.file).open("rb") as file:
                rows = [_row(self.file, k, line, len(target.joints)) for k, line in enumerate(file, start=1)]
        except OSError as error:
            raise InputError.at(self.file, "", str(error.strerror), "give a file that can be read") from error
        if not rows:
            raise InputError.at(self.file, "", "it is empty", "record at least one instant")
        samples = tuple(
            JointSample(source=self.name, target=self.robot, seq=seq, t=t - rows[0][0], q=q)
            for seq, (t, q) in enumerate(rows)
        )
        return Opened(samples=samples, duration=samples[-1].t, began=rows[0][0])


def _row(file: str, k: int, line: bytes, joints: int) -> tuple[float, tuple[float, ...]]:
    """Instant and joint positions of one line."""
    try:
        said = json.loads(line)
        t, q = float(said["t"]), tuple(map(float, said["q"]))
    except (ValueError, TypeError, KeyError) as error:
        remedy = 'write {"t": seconds, "q": [radians]}'
        raise InputError.at(file, f"line {k}", f"cannot be read: {error}", remedy) from error
    if len(q) != joints or not all(map(math.isfinite, (t, *q))):
        raise InputError.at(file, f"line {k}", f"{len(q)} values", f"give {joints} finite numbers")
    return t, q
