// What a page makes of a headset: names, numbers, and one message per picture.

import assert from "node:assert/strict";
import { test } from "node:test";
import { load, together } from "./source.mjs";

const { sight, handName } = await load("xr/sight");

const pose = (x, emulatedPosition = false) => ({
  emulatedPosition,
  transform: { position: { x, y: 1, z: 2 }, orientation: { x: 0.1, y: 0.2, z: 0.3, w: 0.9 } },
});
const FLOOR = { name: "floor" };

/** A headset whose spaces are numbers: the x at which they are; null for one that is lost. */
function frameOf({ viewer = 0, body } = {}) {
  return {
    body,
    getViewerPose: (space) => (space === FLOOR && viewer !== null ? pose(viewer) : undefined),
    getPose: (each, space) => (space === FLOOR && each.x !== null ? pose(each.x, each.guessed) : undefined),
  };
}
const grip = (handedness, x) => ({ handedness, gripSpace: { x }, hand: undefined });
const floats = (seen) => new Float32Array(seen.poses.buffer);

test("head and controllers, w first, what is lost as NaN", () => {
  const seen = sight(
    frameOf(),
    FLOOR,
    [grip("left", -1), grip("right", null), grip("none", 5)],
    "anna",
    1500,
  );
  assert.deepEqual(seen.names, ["viewer", "left-grip", "right-grip"]);
  assert.deepEqual([seen.type, seen.human, seen.t], ["tracking", "anna", 1.5]);
  const numbers = [...floats(seen)].map((v) => Math.round(v * 1000) / 1000);
  assert.deepEqual(numbers.slice(7, 14), [-1, 1, 2, 0.9, 0.1, 0.2, 0.3]);
  assert.ok(numbers.slice(14).every(Number.isNaN));
});

test("nothing is offered while the headset itself is lost", () => {
  assert.equal(sight(frameOf({ viewer: null }), FLOOR, [grip("left", 1)], "anna", 0), null);
});

test("hands have the names of Body Tracking, and a body wins over a hand", () => {
  assert.equal(handName("left", "index-finger-metacarpal"), "left-hand-index-metacarpal");
  const hand = new Map([
    ["wrist", { x: 3 }],
    ["thumb-tip", { x: 4 }],
  ]);
  const body = new Map([
    ["hips", { x: 1, guessed: true }],
    ["left-hand-wrist", { x: 2 }],
  ]);
  const source = { handedness: "left", gripSpace: { x: 9 }, hand };
  const seen = sight(frameOf({ body }), FLOOR, [source], "anna", 0);
  assert.deepEqual(seen.names, ["viewer", "hips", "left-hand-wrist", "left-hand-thumb-tip"]);
  assert.deepEqual(
    [0, 1, 2, 3].map((k) => floats(seen)[7 * k]),
    [0, 1, 2, 4],
  );
  assert.deepEqual([...seen.guessed], [0, 1, 0, 0]);
});

test("a body and two hands are not more than the server takes", () => {
  const body = new Map(Array.from({ length: 300 }, (_, k) => [`joint-${k}`, { x: k }]));
  assert.equal(sight(frameOf({ body }), FLOOR, [], "anna", 0).names.length, 160);
});

test("the board says of every undecided criterion why, also beside a figure", async () => {
  globalThis.location = { search: "" };
  const [{ Board }, { scene, frame }] = await together("xr/board", "page_state");
  const criterion = (name, verdict, value, reason) => [
    { name, kind: "k", group: "safety", title: "", unit: "m", limit: 0.5, at_most: false, subjects: [] },
    { name, verdict, value, unit: "m", limit: 0.5, at_most: false, reason },
  ];
  const all = [
    criterion("far", "within", 0.9, "table ↔ operator"),
    criterion("open", "undecided", 0.7, "ur10: not heard for 0.31 s (time-out 0.2 s)"),
    criterion("lost", "undecided", null, "nothing heard yet"),
  ];
  scene.value = { criteria: all.map(([info]) => info), nodes: [], mechanisms: [] };
  frame.value = { results: all.map(([, result]) => result) };
  const lines = Object.fromEntries(Board.lines().map((line) => [line.text, line]));
  assert.equal(lines.open.reason, "ur10: not heard for 0.31 s (time-out 0.2 s)");
  assert.equal(lines.open.figure, "0.7 / 0.5\u00a0m");
  assert.deepEqual([lines.lost.figure, lines.lost.reason], ["", "nothing heard yet"]);
  assert.equal(lines.far.reason, "");
});
