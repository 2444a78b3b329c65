"""Everything that a variable may be bound to, told by a PLC of another maker through OPC UA while it runs."""

from __future__ import annotations

import math

import pytest

from foreign_opcua import URI, foreign_opcua
from kept_run import Chapters
from seerob import load

STATION = """
variables = "variables.toml"
[engine]
physics = false
[[confirmed]]
key = "sources[0].timeout"
of = "plc"
value = 3.0
why = "of a server that shares a busy machine with its client"
[[confirmed]]
key = "safety[7].limit"
of = "sensor"
value = 1000.0
why = "how long they disagree is not what is asked"
[[sources]]
kind = "opcua"
name = "plc"
url = "URL"
timeout = 3
[[machines]]
name = "axis"
shape = { box = [0.2, 0.2, 0.2] }
slide = { position = "axis" }
[[machines]]
name = "crate"
at = { position = [0, 3, 0] }
shape = { box = [0.2, 0.2, 0.2] }
belt = { length = 10, position = "belt" }
[[machines]]
name = "cart"
at = { position = [0, 6, 0] }
shape = { box = [0.2, 0.2, 0.2] }
vehicle = { x = "x", y = "y", heading = "heading" }
[[machines]]
name = "table"
at = { position = [-6, 0, 0] }
shape = { box = [1, 0.2, 0.2] }
turn = { angle = "turned" }
[[machines]]
name = "agv"
at = { position = [0, 12, 0] }
shape = { box = [0.2, 0.2, 0.2] }
route = { points = [[0, 0], [4, 0]], position = "way" }
[[machines]]
name = "hand"
on = "axis"
at = { position = [0, 0, 1] }
shape = { box = [0.02, 0.02, 0.06] }
grip = { opening = "hand", upper = 0.1 }
[[workpieces]]
name = "nut"
on = "hand"
shape = { box = [0.04, 0.04, 0.04] }
rest = { position = [1, 0, 1] }
[[parts]]
name = "post"
at = { position = [-1, 0, 0] }
shape = { box = [0.2, 0.2, 0.2] }
[[parts]]
name = "corner"
at = { position = [-6, 2, 0] }
shape = { box = [0.2, 0.2, 0.2] }
[[parts]]
name = "dock"
at = { position = [5, 12, 0] }
shape = { box = [0.2, 0.2, 0.2] }
[[parts]]
name = "lamp"
at = { position = [-1, 6, 0] }
shape = { box = [0.2, 0.2, 0.2] }
[[areas]]
name = "loading"
at = { position = [0, 6, 0] }
shape = { box = [1, 1, 1] }
[[displays]]
of = "lamp"
variable = "armed"
colors = { true = [0.0, 1.0, 0.0], false = [1.0, 0.0, 0.0] }
[[displays]]
of = "post"
variable = "mode"
hidden = ["manual"]
[[safety]]
kind = "minimum_distance"
name = "joint"
between = ["axis/body", "post"]
[[safety]]
kind = "minimum_distance"
name = "conveyor"
between = ["crate", "lamp"]
[[safety]]
kind = "minimum_distance"
name = "pose"
between = ["cart", "lamp"]
[[safety]]
kind = "minimum_distance"
name = "fingers"
between = ["hand/left", "hand/right"]
[[safety]]
kind = "minimum_distance"
name = "held"
between = ["nut", "post"]
[[safety]]
kind = "minimum_distance"
name = "turned"
between = ["table", "corner"]
[[safety]]
kind = "minimum_distance"
name = "way"
between = ["agv", "dock"]
[[safety]]
kind = "sensor_agreement"
name = "sensor"
variable = "clear"
field = "loading"
of = "cart"
limit = 1000
[[safety]]
kind = "variable"
name = "curtain"
variable = "clear"
expected = true
[[safety]]
kind = "safety_area"
name = "area"
area = "loading"
of = "cart"
active = "armed"
"""
NUMBERS = {"axis": ("mm", 1000.0), "belt": ("mm", 500.0), "x": ("m", 0.0), "y": ("m", 0.0)}
NUMBERS |= {"heading": ("deg", 90.0), "hand": ("mm", 100.0), "turned": ("deg", 0.0), "way": ("mm", 1000.0)}
DEVICE_FREE = "the device says free, the twin interrupted"
DEVICE_INTERRUPTED = "the device says interrupted, the twin free"


def dictionary():
    told = {name: f'unit = "{unit}"' for name, (unit, _) in NUMBERS.items()}
    told |= dict.fromkeys(("clear", "armed"), 'type = "bool"')
    told["mode"] = 'type = "choice"\nchoices = { 1 = "automatic", 2 = "manual" }'
    for name, what in told.items():
        yield f'[[variables]]\nname = "{name}"\nsource = "plc"\naddress = "nsu={URI};s={name}"\n{what}\n'


def says(snapshot, **expected):
    """Whether results have these values, to a tenth of a millimetre."""
    found = {r.name: r.value for r in snapshot.results}
    return all(found[n] is not None and abs(found[n] - v) < 1e-4 for n, v in expected.items())


def reason(snapshot, name):
    return next(r.reason for r in snapshot.results if r.name == name)


def verdicts(snapshot):
    return {r.name: r.verdict for r in snapshot.results}


def test_joints_belts_poses_routes_turns_fingers_sensors_areas_and_lamps(tmp_path):
    pytest.importorskip("asyncua")
    first = {name: value for name, (_, value) in NUMBERS.items()}
    first |= {"clear": True, "armed": False, "mode": 1}
    with foreign_opcua(first) as (url, nodes):
        (tmp_path / "workstation.toml").write_text(STATION.replace("URL", url))
        (tmp_path / "variables.toml").write_text("".join(dictionary()))

        def tell(**values):
            for name, value in values.items():
                nodes[name].write_value(value)

        story = Chapters(
            (
                lambda s: (
                    says(s, joint=1.8, conveyor=math.hypot(1.3, 2.8), pose=0.8, fingers=0.1)
                    and says(s, turned=1.8, way=3.8)
                    and reason(s, "sensor") == DEVICE_FREE
                    and verdicts(s)["curtain"] == "within"
                    and verdicts(s)["area"] is None
                    and s.looks == {"lamp": (1.0, 0.0, 0.0)}
                ),
                lambda: tell(armed=True, clear=False, mode=2, hand=45.0, turned=90.0),
            ),
            (
                lambda s: (
                    says(s, fingers=0.045, turned=1.4, sensor=0.0)
                    and reason(s, "sensor") == ""
                    and verdicts(s)["curtain"] == verdicts(s)["area"] == "exceeded"
                    and s.looks == {"lamp": (0.0, 1.0, 0.0), "post": None}
                ),
                lambda: tell(axis=500.0, x=3.0, belt=1000.0, way=3000.0),
            ),
            (
                # The cart has left the area; the workpiece went with the hand.
                lambda s: (
                    says(s, joint=1.3, conveyor=math.hypot(1.8, 2.8), pose=3.8, held=math.hypot(1.38, 0.88))
                    and says(s, way=1.8)
                    and verdicts(s)["area"] == "within"
                    and reason(s, "sensor") == DEVICE_INTERRUPTED
                ),
                lambda: None,
            ),
        )
        load(tmp_path).run(live=True, writers=[story], folder=tmp_path / "run", stop=story.stop)
