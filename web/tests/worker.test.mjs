// The worker by itself: what the socket brings is counted, acknowledged and kept, whatever the page does meanwhile.

import assert from "node:assert/strict";
import { test } from "node:test";
import { decode, encode } from "@msgpack/msgpack";
import { load } from "./source.mjs";

const FRAMES = 400;
const { FIELDS } = await load("wire");
const { PoseReader } = await load("poses");
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
  // The page asked for one: of the others it gets the newest, when it asks again.
  assert.deepEqual(
    told("frame").map(({ shown }) => shown.t),
    [0.01],
  );
  assert.equal(new PoseReader(told("scene")[0].shared).read()[0], FRAMES);
  self.onmessage({ data: { kind: "want", whole: true } });
  assert.equal(told("frame").at(-1).frame.t, FRAMES / 100);
});
