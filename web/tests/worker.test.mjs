// The worker by itself: what the socket brings is counted, acknowledged and kept, whatever the page does meanwhile.

import assert from "node:assert/strict";
import { test } from "node:test";
import { decode, encode } from "@msgpack/msgpack";
import { load } from "./source.mjs";

const FRAMES = 400;
const { FIELDS } = await load("wire");
const { FormNumbers, PoseReader } = await load("poses");
const { Form, numbersOf, countOf, HEAD } = await load("form");
const { DRAWN, PANELS } = await load("messages");
const posted = [];
const sent = [];
const timers = [];
let socket;
globalThis.self = { postMessage: (message) => posted.push(message) };
globalThis.setInterval = (each) => timers.push(each);
globalThis.WebSocket = class {
  static OPEN = 1;
  readyState = 1;
  constructor() {
    socket = this;
  }
  send(bytes) {
    sent.push(decode(bytes));
  }
};
await load("worker");

const hear = (message) => socket.onmessage({ data: encode(message).slice().buffer });
const told = (kind) => posted.filter((message) => message.kind === kind);
const readPoses = (form) => {
  const reader = new PoseReader(told("scene")[0].shared);
  reader.form = form;
  return reader.read();
};
const result = (k) => {
  const said = { name: "speed", value: k, limit: 1e6, at_most: true, verdict: "within" };
  return FIELDS.result.map((name) => said[name] ?? (/^(parts|markers|rows)$/.test(name) ? [] : null));
};

test("no frame is lost in the worker while the page draws nothing", () => {
  self.onmessage({ data: { kind: "connect", url: "ws://here/ws", shared: true } });
  socket.onopen();
  hear({ type: "hello", mode: "live" });
  hear({ type: "scene", nodes: [{ name: "a" }], criteria: [], period: 0.01 });
  for (let k = 1; k <= FRAMES; k += 1) {
    const poses = new Uint8Array(Float32Array.from([k, 0, 0, 1, 0, 0, 0]).buffer);
    hear({ type: "snapshot", seq: k, t: k / 100, poses, results: [result(k)] });
  }
  for (const each of timers) each();
  const points = told("points").flatMap((message) => message.points);
  assert.deepEqual(
    points.flatMap(({ values }) => [...values]),
    Array.from({ length: FRAMES }, (_, k) => k + 1),
  );
  // Whoever acknowledges one has all before it.
  const acknowledged = sent.filter(({ action }) => action === "ack").map(({ value }) => value);
  assert.deepEqual(
    acknowledged,
    Array.from({ length: FRAMES / 4 }, (_, k) => 4 * (k + 1)),
  );
  // What the page drew first has its form since, and numbers come through memory that both share: the newest alone.
  const [{ shown, id, numbers }] = told("form");
  assert.equal(told("form").length, 1);
  assert.equal(shown.t, 0.01);
  const form = new Form(structuredClone(shown));
  const reader = new FormNumbers(numbers);
  assert.equal(reader.read(), null); // of a form that is not known here yet
  reader.form = id;
  const newest = reader.read();
  assert.equal(newest[0], FRAMES / 100);
  form.fill(newest);
  assert.ok(form.numbers.includes(FRAMES) && form.numbers.includes(FRAMES / 100));
  assert.equal(readPoses(id)[0], FRAMES);
  // Panels get the newest, too, when they ask again.
  assert.deepEqual(
    told("frame").map(({ frame }) => frame.t),
    [0.01],
  );
  Atomics.store(new Int32Array(told("scene")[0].asks), PANELS, 1);
  for (const each of timers) each();
  assert.equal(told("frame").at(-1).frame.t, FRAMES / 100);
});

test("what has another form is told once the page has drawn the one before it, and then the newest", () => {
  const say = (k, ...results) => {
    const poses = new Uint8Array(Float32Array.from([k, 0, 0, 1, 0, 0, 0]).buffer);
    hear({ type: "snapshot", seq: k, t: k / 100, poses, results });
  };
  say(FRAMES + 1, result(1), result(2));
  say(FRAMES + 2, result(3), result(4));
  assert.equal(told("form").length, 1);
  const { id } = told("form")[0];
  // Bodies are not ahead of what is said of them.
  assert.equal(readPoses(id)[0], FRAMES);
  Atomics.store(new Int32Array(told("scene")[0].asks), DRAWN, id);
  for (const each of timers) each();
  assert.deepEqual(
    told("form")[1].shown.results.map(({ value }) => value),
    [3, 4],
  );
  assert.equal(readPoses(id), null);
  assert.equal(readPoses(told("form")[1].id)[0], FRAMES + 2);
});

test("of another scene panels get the first figures, whatever became of those before", () => {
  const frames = told("frame").length;
  hear({ type: "scene", nodes: [{ name: "a" }], criteria: [], period: 0.01 });
  hear({ type: "snapshot", seq: 1, t: 0.01, poses: new Uint8Array(28), results: [result(1)] });
  assert.equal(told("frame").length, frames + 1);
});

test("numbers of a form are those of the value it is filled from, and nothing else passes for it", () => {
  const shown = (x, { radius = 1, verdict = "within", look = [0.1, 0.2, 0.3], hits = [0] } = {}) => ({
    t: x,
    looks: { lamp: look, text: [x, 0, 0] },
    doubts: {},
    results: [
      {
        ...{ name: "gap", value: x, limit: null, at_most: false, verdict },
        markers: [
          { type: "segment", start: [x, 0, 0], end: [0, x, 0], label: `${x} m`, verdict },
          { type: "sphere", center: [0, 0, x], radius, label: "", verdict: null },
          { type: "rays", starts: [[0, 0, x]], ends: [[x, 1, 2]], hits, filled: true, label: "", verdict },
        ],
      },
      { name: "speed", value: 1 / x, limit: 1.05, at_most: true, verdict, markers: [] },
    ],
  });
  const form = shown(1);
  const numbers = new Float64Array(HEAD + countOf(form));
  assert.equal(numbersOf(form, shown(2, { radius: 3 }), numbers, HEAD), numbers.length);
  const drawn = new Form(structuredClone(form));
  assert.deepEqual([drawn.stateOf(1, null), drawn.stateOf(1, numbers)], ["close", "within"]);
  assert.ok(drawn.fill(numbers));
  assert.equal(drawn.stateOf(1, null), "within");
  assert.ok(!drawn.fill(numbers));
  const plain = JSON.stringify(drawn.shown, (_, v) => (v instanceof Float64Array ? [...v] : v));
  assert.deepEqual(drawn.numbers.slice(HEAD), numbers.slice(HEAD));
  // What is written is the panels' affair, and a value that leaves its state as it was stands in the numbers alone.
  const looks = JSON.parse(JSON.stringify(shown(2, { radius: 3 })).replace("2 m", "1 m"));
  [looks.t, looks.results[0].value] = [1, 1];
  assert.deepEqual({ ...JSON.parse(plain) }, looks);
  for (const other of [
    { verdict: "exceeded" },
    { radius: null },
    { look: null },
    { hits: [] },
    { hits: [0, 1] },
  ])
    assert.equal(numbersOf(form, shown(2, other), numbers, HEAD), -1, JSON.stringify(other));
});
