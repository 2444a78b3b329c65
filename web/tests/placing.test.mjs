import assert from "node:assert/strict";
import { test } from "node:test";
import { load } from "./source.mjs";

const { placeCaptions } = await load("markers/placing");

// Screen coordinates in and out: the projection is the identity on a square of 800 px.
const view = { camera: { fov: 90, aspect: 1 }, pixel: 1 / 400, margins: true };

function captionAt(x, y, widthPx, aside = false, heightPx = aside ? 36 : 24) {
  const caption = { liftedPx: 0, rightPx: 0, widthPx, heightPx, aside, side: 0, object: {} };
  const at = { x, y };
  caption.object.getWorldPosition = (to) => {
    to.set(at.x / 400, at.y / 400, 0);
    to.project = () => to;
    return to;
  };
  caption.lift = () => {};
  return { caption, at, x, y, widthPx, heightPx };
}

const place = (all, seen = view) =>
  placeCaptions(
    all.map((c) => c.caption),
    seen,
  );
const boxOf = ({ caption, at, widthPx, heightPx }) => {
  const [x, low] = [at.x + caption.rightPx, at.y + caption.liftedPx];
  return { left: x - widthPx / 2, right: x + widthPx / 2, low, high: low + heightPx };
};

function random(seed) {
  let state = seed;
  return () => {
    state = (state * 16807) % 2147483647;
    return state / 2147483647;
  };
}

function assertApart(all) {
  const boxes = all.map(boxOf);
  for (const [i, a] of boxes.entries()) {
    for (const b of boxes.slice(0, i)) {
      const apart =
        a.left >= b.right - 1e-6 || b.left >= a.right - 1e-6 || a.low >= b.high || b.low >= a.high;
      assert.ok(apart, JSON.stringify([a, b]));
    }
  }
}

test("no two names cover each other, and one alone stays where it belongs", () => {
  const next = random(7);
  for (let round = 0; round < 200; round += 1) {
    const all = Array.from({ length: 6 }, () =>
      captionAt(next() * 100, next() * 60, 20 + Math.round(next() * 80)),
    );
    place(all);
    assert.equal(all[0].caption.liftedPx, 0);
    for (const { caption } of all) assert.ok(caption.liftedPx >= 0);
    assertApart(all);
  }
});

test("figures go to the sides and leave the middle free, below the tools, above the legend, none over another", () => {
  const next = random(11);
  for (let round = 0; round < 200; round += 1) {
    const figures = Array.from({ length: 8 }, () =>
      captionAt(next() * 700 - 350, next() * 700 - 350, 90 + Math.round(next() * 110), true),
    );
    const names = Array.from({ length: 2 }, () => captionAt(next() * 100 - 50, next() * 100, 60));
    place([...figures, ...names]);
    assertApart([...figures, ...names]);
    for (const { left, right, low, high } of figures.map(boxOf)) {
      assert.ok(Math.abs(left + 390) < 1e-6 || Math.abs(right - 390) < 1e-6, `${left} ${right}`);
      assert.ok(low >= -350 && high <= 350, `${low} ${high}`);
    }
  }
});

test("one figure is level with what it is about, at the nearer side, and keeps that near the middle", () => {
  const one = captionAt(100, 40, 120, true);
  place([one]);
  const { right, low, high } = boxOf(one);
  assert.ok(Math.abs(right - 390) < 1e-6 && low < 40 && high > 40);
  one.at.x = -30;
  place([one]);
  assert.ok(boxOf(one).left > 0);
  one.at.x = -100;
  place([one]);
  assert.ok(boxOf(one).right < 0);
});

test("in a narrow room figures are at its upper edge; in a headset they stay at their places", () => {
  const one = captionAt(0, 0, 120, true);
  place([one], { camera: { fov: 90, aspect: 0.5 }, pixel: 1 / 400, margins: true });
  assert.ok(boxOf(one).high > 330);
  place([one], { ...view, margins: false });
  assert.deepEqual([one.caption.liftedPx, one.caption.rightPx], [0, 0]);
});

test("at the upper edge of the room names go down, not behind the tools", () => {
  const all = Array.from({ length: 5 }, () => captionAt(0, 300, 60));
  place(all);
  const places = all.map((c) => 300 + c.caption.liftedPx).sort((a, b) => a - b);
  assert.ok(places.at(-1) + 24 <= 400 - 50);
  for (const [i, y] of places.slice(1).entries()) assert.ok(y - places[i] >= 24, `${places}`);
});

test("at a side of the room names stay in sight, as far as the room is wide enough", () => {
  const shifted = (x, width) => {
    const one = captionAt(x, 0, width);
    place([one]);
    return one.caption.rightPx;
  };
  assert.equal(shifted(100, 200), 0);
  assert.ok(Math.abs(shifted(390, 200) + 90) < 1e-9);
  assert.ok(Math.abs(shifted(-390, 200) - 90) < 1e-9);
  assert.equal(shifted(390, 900), 0);
  assert.equal(shifted(500, 200), 0);
});
