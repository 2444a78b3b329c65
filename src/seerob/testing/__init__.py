"""Whether criteria can be wrongly green: one line for those that ship and for one's own.

``never_within("my_cell")`` takes a workstation in which every criterion is within (or informs), says where
everybody is, and then spoils what is said: of each robot, person and machine that a criterion depends on,
and of its variables. A criterion fails when it, a part, a row or a marker of it is within all the same; when
it rests on somebody whom it does not declare (`Criterion.depends`), on chance, on the time of day, or on what
was before without saying so (`Criterion.remembers`); when limbs that nobody is sure of could be where it is
exceeded; when it loses more between two ticks than `Criterion.falls` says; or when it is no criterion (no
basis, a result that contradicts itself).

``sources_never_within("my_cell")`` takes one in which every criterion is within while its files are played,
and lets each source lie: it stops, fails, repeats itself, goes back in time, speaks of the future, jumps,
says what is no number or of the wrong shape. A live source is listened to for some seconds, and what it said
goes the way that it goes in a run, from the listener on, without a lie and with each.

As a plug-in of pytest, without a test file: ``pytest -p seerob.testing my_cell/workstation.toml`` asks both.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from seerob.devices.live.listening import LiveSource
from seerob.session.station import load
from seerob.testing.criteria import never_within
from seerob.testing.sources import LIVE_LIES, sources_never_within

__all__ = ["LIVE_LIES", "never_within", "sources_never_within"]


# -- plug-in of pytest ----------------------------------------------------------------------------


def pytest_collect_file(parent: Any, file_path: Path) -> Any:
    """Collect a ``workstation.toml`` that is named on the command line."""
    if file_path.suffix != ".toml" or not parent.session.isinitpath(file_path):
        return None
    import pytest

    class Cell(pytest.Item):
        def runtest(self) -> None:
            station = load(file_path, allow_plugins=True)
            never_within(station)
            if not all(isinstance(source, LiveSource) for source in station.workstation.sources):
                sources_never_within(station)

        def reportinfo(self) -> tuple[Path, None, str]:
            return file_path, None, f"never within: {file_path}"

    class File(pytest.File):
        def collect(self) -> Iterator[Cell]:
            yield Cell.from_parent(self, name="never_within")

    return File.from_parent(parent, path=file_path)
