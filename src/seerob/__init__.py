"""seerob: safety and ergonomics evaluation of cobotic workstations with a physics-based twin.

```python
import seerob as sr

station = sr.load("workstations/ur10_assembly")
run = station.run()
print(run.results["tcp speed"].max(), run.verdict)
```

The names below come in the order in which data meets them.
"""

from seerob.errors import InputError, SeerobError, Undecided, UnknownName
from seerob.model import Model
from seerob.reading import read
from seerob.recording import Recording
from seerob.results import ResultLog, Series
from seerob.run import Summary
from seerob.snapshot import Origin, Result, Snapshot, Verdict
from seerob.station import Station, load, load_recorded
from seerob.workstation import Workstation

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
