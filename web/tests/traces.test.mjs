import assert from "node:assert/strict";
import { test } from "node:test";
import { load } from "./source.mjs";

const { Trace, neighbourViolation } = await load("traces");
const { windowOf } = await load("plots/window");

function traceOf(points, capacity, name = "x") {
  const trace = new Trace(name, capacity);
  const column = (i) => points.map((p) => p[i]);
  trace.append({
    name: "x",
    t: Float64Array.from(column(0)),
    values: Float64Array.from(column(1)),
    limits: Float64Array.from(column(2)),
    verdicts: Uint8Array.from(column(3)),
  });
  return trace;
}

test("a verdict holds from its point to the next; silence ends it", () => {
  const trace = traceOf([
    [0.0, 1, 2, 0],
    [0.1, 3, 2, 1],
    [0.2, 3, 2, 1],
    [0.3, 1, 2, 2],
    [0.4, 1, 2, 0],
    [0.5, 3, 2, 1],
    [9.0, 3, 2, 1],
  ]);
  assert.deepEqual(trace.spans, [
    { start: 0.1, end: 0.3, verdict: "exceeded" },
    { start: 0.3, end: 0.4, verdict: "undecided" },
    { start: 0.5, end: 0.5, verdict: "exceeded" },
    { start: 9.0, end: 9.0, verdict: "exceeded" },
  ]);
});

test("previous and next violation over all traces", () => {
  const a = traceOf([
    [1, 0, 0, 1],
    [1.1, 0, 0, 0],
    [5, 0, 0, 1],
  ]);
  const b = traceOf([
    [2, 0, 0, 2],
    [3, 0, 0, 1],
    [3.1, 0, 0, 0],
  ]);
  const go = (t, forward) => neighbourViolation([a, b], t, forward);
  assert.deepEqual([go(0, true), go(1, true), go(3, true), go(5, true)], [1, 3, 5, null]);
  assert.deepEqual([go(6, false), go(5, false), go(3, false), go(1, false)], [5, 3, 1, null]);
});

test("a point holds to the next one; before the first and after the last none does", () => {
  const trace = traceOf([
    [1, 5, 0, 0],
    [2, 6, 0, 0],
  ]);
  assert.deepEqual(
    [0.9, 1, 1.5, 2, 2.1].map((t) => trace.indexHolding(t)),
    [-1, 0, 0, 1, -1],
  );
  assert.equal(traceOf([]).indexHolding(0), -1);
});

test("thinning keeps the extremes, the verdicts' changes and the order", () => {
  const spike = 1234;
  const points = Array.from({ length: 20_000 }, (_, i) => {
    const value = i === spike ? 99 : Math.sin(i / 50);
    return [i * 0.01, value, 50, value > 50 ? 1 : 0];
  });
  const trace = traceOf(points, 2000);
  assert.ok(trace.length <= 2000);
  const kept = [...trace.values.subarray(0, trace.length)];
  assert.equal(Math.max(...kept), 99);
  const times = [...trace.t.subarray(0, trace.length)];
  assert.ok(times.every((t, i) => i === 0 || t > times[i - 1]));
  assert.equal(times.at(-1), 199.99);
  assert.deepEqual(
    trace.spans.map((s) => s.verdict),
    ["exceeded"],
  );
});

test("a plot's window shows every extremum and leaves gaps where there was no value", () => {
  const points = Array.from({ length: 10_000 }, (_, i) => [i, i === 7777 ? -5 : i === 1111 ? 8 : 0, 1, 0]);
  points[5000][1] = Number.NaN;
  const [t, values, limits] = windowOf(traceOf(points), 0, 9999, 200);
  assert.ok(t.length <= 700);
  assert.ok(values.includes(-5) && values.includes(8) && values.includes(null));
  assert.ok(limits.every((x) => x === 1));
  const zoomed = windowOf(traceOf(points), 100, 110, 200)[0];
  assert.deepEqual(
    zoomed,
    Array.from({ length: 12 }, (_, i) => 99 + i),
  );
});

test("what never was within only informs", () => {
  const nothing = [0, 1, Number.NaN, 255];
  const undecided = [1, 1, Number.NaN, 2];
  assert.deepEqual([traceOf([nothing, undecided]).kept, traceOf([nothing, undecided]).judged], [false, true]);
  assert.equal(traceOf([nothing, undecided, [2, 1, Number.NaN, 0]]).kept, true);
});
