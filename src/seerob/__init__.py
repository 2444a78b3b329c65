"""seerob: safety and ergonomics evaluation of cobotic workstations with a physics-based twin.

```python
import seerob as sr

station = sr.load("workstations/ur10_assembly")
run = station.run()
print(run.results["tcp speed"].max(), run.verdict)
```

The names below come in the order in which data meets them. Each is imported when it is first used:
the command line's help, and whoever needs only one of them, does not wait for the physics.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from seerob.errors import InputError, SeerobError, Undecided, UnknownName
    from seerob.model import Model
    from seerob.reading import read
    from seerob.recorded_station import load_recorded
    from seerob.recordings.recording import Recording
    from seerob.results.result_log import ResultLog, Series
    from seerob.run import Summary
    from seerob.snapshot import Origin, Result, Snapshot, Verdict
    from seerob.station import Station, load
    from seerob.workstation import Workstation

_HOMES = {
    "errors": ("InputError", "SeerobError", "Undecided", "UnknownName"),
    "model": ("Model",),
    "reading": ("read",),
    "recordings.recording": ("Recording",),
    "results.result_log": ("ResultLog", "Series"),
    "run": ("Summary",),
    "snapshot": ("Origin", "Result", "Snapshot", "Verdict"),
    "recorded_station": ("load_recorded",),
    "station": ("Station", "load"),
    "workstation": ("Workstation",),
}
_HOME = {name: home for home, names in _HOMES.items() for name in names}

__all__ = [
    "InputError",
    "Model",
    "Origin",
    "Recording",
    "Result",
    "ResultLog",
    "SeerobError",
    "Series",
    "Snapshot",
    "Station",
    "Summary",
    "Undecided",
    "UnknownName",
    "Verdict",
    "Workstation",
    "load",
    "load_recorded",
    "read",
]


def __getattr__(name: str) -> object:
    if name not in _HOME:
        raise AttributeError(f"module 'seerob' has no attribute {name!r}")
    found: object = getattr(import_module(f"seerob.{_HOME[name]}"), name)
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
