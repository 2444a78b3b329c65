"""Results as a DataFrame: every criterion over time, what the run comes to, and a plot (extra ``data``)."""

from pathlib import Path
from tempfile import TemporaryDirectory

import seerob as sr

station = sr.load(Path(__file__).parents[1] / "workstations" / "iiwa_bench")
run = station.run()

frame = run.results.to_pandas()  # one row per instant, one column per criterion
print(frame["value"].describe().loc[["min", "max"]].T)
whole = run.results.to_pandas("criteria")  # one row per criterion
print(whole[["verdict", "worst_t", "worst_value", "worst_limit", "unit"]])

with TemporaryDirectory() as folder:
    file = Path(folder) / "run.png"
    run.plot("tool speed", "separation").savefig(file)
    drawn = file.stat().st_size

# The worst of the instants is never better than the run, which also is what lies between them.
assert list(whole.index) == list(run.results)
assert (whole.verdict >= frame["verdict"].max()).all()
assert frame.attrs["criteria"]["tool speed"]["unit"] == "m/s"
assert frame["value"]["tool speed"].max() == run.results["tool speed"].max()
assert drawn > 10_000
