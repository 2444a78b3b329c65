// What a run holds that is worse than what is shown, and where it was at its worst.

import assert from "node:assert/strict";
import { test } from "node:test";
import { load } from "./source.mjs";

const { against } = await load("figures");
const { Trace, traceFromWire } = await load("traces");
const { ago, worseElsewhere } = await load("elsewhere");
const { heldAt, worstInstants, worstWith } = await load("worst_instant");

const [W, E, U, N] = [0, 1, 2, 255];

function trace(name, verdicts, values = verdicts.map(() => 1), limit = 1) {
  const made = new Trace(name);
  made.append({
    name,
    t: Float64Array.from(verdicts, (_, i) => i),
    values: Float64Array.from(values),
    limits: Float64Array.from(verdicts, () => limit),
    verdicts: Uint8Array.from(verdicts),
  });
  return made;
}

test("a run that once was worse is never told as within, and nothing worse is told of the worst", () => {
  const before = trace("separation", [W, E, E, W, W]);
  assert.equal(worseElsewhere([before], "within").verdict, "exceeded");
  assert.equal(worseElsewhere([before], "undecided").verdict, "exceeded");
  assert.equal(worseElsewhere([before], "exceeded"), null);
  const open = trace("mass", [U, W, W]);
  assert.equal(worseElsewhere([open], "within").verdict, "undecided");
  assert.equal(worseElsewhere([open], "undecided"), null);
  assert.equal(worseElsewhere([trace("a", [W, W]), trace("b", [N, N])], "within"), null);
});

test("an exceedance is told before anything undecided, and who had it last is named with its end", () => {
  const found = worseElsewhere(
    [trace("mass", [U, U, U, U, W]), trace("speed", [E, W, W, W, W]), trace("separation", [W, W, E, W, W])],
    "within",
  );
  assert.equal(found.verdict, "exceeded");
  assert.deepEqual(found.criteria, ["speed", "separation"]);
  // A verdict holds from its point to the next one.
  assert.deepEqual(found.latest, { name: "separation", end: 3 });
});

test("a limit out of a trace of the wire is the one that was given, whatever its digits", () => {
  const bytes = (numbers) => new Uint8Array(Float64Array.from(numbers).buffer);
  const wire = { name: "gap", t: bytes([0]), values: bytes([0.15]), limits: bytes([0.15]), verdicts: [0] };
  const { value, limit } = worstInstants(traceFromWire(wire, 10), false, 1)[0];
  assert.deepEqual(against(value, limit, "m", false), { value: "0.15", limit: "0.15" });
});

test("how long ago is said in words", () => {
  assert.deepEqual([0.2, 12.9, 89, 90, 5399, 7200].map(ago), [
    "just now",
    "12 s ago",
    "89 s ago",
    "1 min ago",
    "89 min ago",
    "2 h ago",
  ]);
});

test("the worst instants are the verdict's first, then the margin's, a second apart", () => {
  const values = [3, 9, 2, 8, 7, 1];
  const found = worstInstants(trace("score", [W, W, E, W, W, W], values, 4), true, 3);
  assert.deepEqual(
    found.map(({ t, value }) => [t, value]),
    [
      [2, 2],
      [1, 9],
      [3, 8],
    ],
  );
  const lowest = worstInstants(
    trace(
      "distance",
      values.map(() => W),
      values,
      Number.NaN,
    ),
    false,
    1,
  );
  assert.equal(lowest[0].t, 5);
});

test("brute force agrees on random traces", () => {
  let seed = 7;
  const random = () => {
    seed = (seed * 16807) % 2147483647;
    return seed / 2147483647;
  };
  for (let round = 0; round < 200; round += 1) {
    const n = 1 + Math.floor(random() * 12);
    const verdicts = Array.from({ length: n }, () => [W, E, U, N][Math.floor(random() * 4)]);
    const values = verdicts.map((v) => (v === U && random() < 0.5 ? Number.NaN : random()));
    const atMost = random() < 0.5;
    const rank = (i) => [E, U, W, N].indexOf(verdicts[i]);
    const left = (i) => {
      if (Number.isNaN(values[i])) return verdicts[i] === E ? -Infinity : Infinity;
      return atMost ? 0.5 - values[i] : values[i] - 0.5;
    };
    const best = verdicts
      .map((_, i) => i)
      .filter((i) => !Number.isNaN(values[i]) || verdicts[i] === E)
      .sort((a, b) => rank(a) - rank(b) || left(a) - left(b))[0];
    const found = worstInstants(trace("x", verdicts, values, 0.5), atMost, 1)[0];
    assert.equal(found?.t, best);
  }
});

test("the worst of a verdict, and what held at an instant", () => {
  const one = trace("distance", [W, E, E, W], [5, 0.4, 0.1, 4]);
  assert.equal(worstWith(one, false, "exceeded").t, 2);
  assert.equal(worstWith(one, false, "undecided"), null);
  assert.equal(heldAt(one, 2.7).t, 2);
  assert.equal(heldAt(one, 3).t, 3);
  assert.equal(heldAt(one, -0.1), null);
});
