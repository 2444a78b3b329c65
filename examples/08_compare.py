"""Two variants of a cell beside each other: what changed in the file, and which verdicts turned."""

from pathlib import Path
from tempfile import TemporaryDirectory

import seerob as sr

CELL = """
title = "bench"

[[robots]]
name = "arm"
model = "library:ur5e"
q_deg = [0, -90, 90, -90, -90, 0]

[[humans]]
name = "person"
stature = 1.75
mass = 75
sex = "female"
at = {{ position = [{x}, 0, 0], rpy_deg = [0, 0, 180] }}

[[safety]]
kind = "minimum_distance"
name = "distance"
between = ["arm", "person"]
limit = 0.5
"""

with TemporaryDirectory() as folder:
    for name, x in (("far", 1.5), ("near", 0.9)):
        (Path(folder) / name).mkdir()
        (Path(folder) / name / "workstation.toml").write_text(CELL.format(x=x))
    found = sr.compare(Path(folder) / "far", Path(folder) / "near")
    page = found.html()  # stands alone; seerob compare … --html writes it with pictures

print(*(found.changes or ()), sep="\n")
for one in found.criteria:
    print(one.name, *one.verdicts, *one.notes)
print(found.sentence())

assert [change.key for change in found.changes or ()] == ['humans["person"].at.position']
assert found.turn == "exceeded"
assert "<script" not in page
