import assert from "node:assert/strict";
import { test } from "node:test";
import { askPython } from "./python.mjs";
import { load } from "./source.mjs";

const { completed } = await load("completed");

const PROGRAM = `
import sys
import msgspec
from msgspec import structs
from seerob.core.snapshot import *

at, turned = (1.0, 2.0, 3.0), (0.0, 1.0, 0.0, 0.0)
markers = (
    Arrow(origin=at, vector=at), Segment(start=at, end=at, label="x", verdict=Verdict.WITHIN),
    Sphere(center=at, radius=1.0), Ellipsoid(center=at, wxyz=turned, radii=at),
    Box(center=at, wxyz=turned, size=at), Hull(vertices=(at,), faces=()), Polyline(points=(at,)),
    Prism(outline=((0.0, 0.0),), lower=0.0, upper=1.0), Rays(starts=(at,), ends=(at,)),
    Label(position=at, text="x"), Highlight(body="r"),
)
row = Row(name="row", scale=(1.0, 7.0), aspects=(Aspect(name="angle", value=20.0, unit="°"),))
part = Result(name="part", value=0.0, nothing=True, rows=(row, Row(name="other")))
results = (Result(name="one", parts=(part,), markers=markers), Result(name="two", at_most=False))
every = [Snapshot(seq=0, t=0.0, poses=b""), Snapshot(seq=1, t=0.5, poses=b"", results=results)]

def whole(thing):
    if isinstance(thing, (tuple, list)):
        return [whole(one) for one in thing]
    if not isinstance(thing, msgspec.Struct):
        return msgspec.to_builtins(thing)
    tag = thing.__struct_config__.tag
    return ({} if tag is None else {"type": tag}) | {k: whole(v) for k, v in structs.asdict(thing).items()}

sys.stdout.buffer.write(msgspec.json.encode([every, whole(every)]))
`;

test("what the sender leaves out and names that it does not send are put back, however deep", async () => {
  const [sent, whole] = await askPython(PROGRAM);
  assert.notDeepEqual(sent, whole);
  assert.deepEqual(sent.map(completed), whole);
});
