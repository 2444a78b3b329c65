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
    from seerob.core.errors import InputError, SeerobError, Undecided, UnknownName
    from seerob.core.snapshot import Origin, Result, Snapshot, Verdict
    from seerob.model.model import Model
    from seerob.outputs.comparison import Comparison
    from seerob.recording.recording import Recording
    from seerob.recording.result_log import ResultLog, Series
    from seerob.session.comparing import compare
    from seerob.session.reading import read
    from seerob.session.run import Summary
    from seerob.session.station import Station, load, load_recorded
    from seerob.workstation.workstation import Workstation

_HOMES = {
    "core.errors": ("InputError", "SeerobError", "Undecided", "UnknownName"),
    "model.model": ("Model",),
    "outputs.comparison": ("Comparison",),
    "session.comparing": ("compare",),
    "session.reading": ("read",),
    "recording.recording": ("Recording",),
    "recording.result_log": ("ResultLog", "Series"),
    "session.run": ("Summary",),
    "core.snapshot": ("Origin", "Result", "Snapshot", "Verdict"),
    "session.station": ("Station", "load", "load_recorded"),
    "workstation.workstation": ("Workstation",),
}
_HOME = {name: home for home, names in _HOMES.items() for name in names}

__all__ = [
    "Comparison",
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
    "compare",
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
