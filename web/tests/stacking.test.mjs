import assert from "node:assert/strict";
import { test } from "node:test";
import { load } from "./source.mjs";

const { stackCaptions } = await load("markers/stacking");

// Screen coordinates in and out: the projection is the identity on a square of 800 px.
const view = { camera: { fov: 90, aspect: 1 }, pixel: 1 / 400 };

function captionAt(x, y, widthPx) {
  const caption = { lifted: 0, right: 0, widthPx, heightPx: 24, object: {} };
  caption.object.getWorldPosition = (to) => {
    to.set(x / 400, y / 400, 0);
    to.project = () => to;
    return to;
  };
  caption.lift = (px, right = 0) => {
    caption.lifted = px;
    caption.right = right;
  };
  return { caption, x, y, widthPx };
}

test("no two captions cover each other, and one alone stays where it belongs", () => {
  let seed = 7;
  const random = () => {
    seed = (seed * 16807) % 2147483647;
    return seed / 2147483647;
  };
  for (let round = 0; round < 200; round += 1) {
    const all = Array.from({ length: 6 }, () =>
      captionAt(random() * 100, random() * 60, 20 + Math.round(random() * 80)),
    );
    stackCaptions(
      all.map((c) => c.caption),
      view,
    );
    assert.equal(all[0].caption.lifted, 0);
    for (const [i, a] of all.entries()) {
      assert.ok(a.caption.lifted >= 0);
      for (const b of all.slice(0, i)) {
        const apart = Math.abs(a.y + a.caption.lifted - b.y - b.caption.lifted);
        assert.ok(Math.abs(a.x - b.x) >= (a.widthPx + b.widthPx) / 2 - 1e-6 || apart >= 24, `${apart} px`);
      }
    }
  }
});

test("at the upper edge of the room captions go down, not behind the tools", () => {
  const all = Array.from({ length: 5 }, () => captionAt(0, 300, 60));
  stackCaptions(
    all.map((c) => c.caption),
    view,
  );
  const places = all.map((c) => 300 + c.caption.lifted).sort((a, b) => a - b);
  assert.ok(places.at(-1) + 24 <= 400 - 50);
  for (const [i, y] of places.slice(1).entries()) assert.ok(y - places[i] >= 24, `${places}`);
});

test("at a side of the room captions stay in sight, as far as the room is wide enough", () => {
  const shifted = (x, width) => {
    const { caption } = captionAt(x, 0, width);
    stackCaptions([caption], view);
    return caption.right;
  };
  assert.equal(shifted(100, 200), 0);
  assert.ok(Math.abs(shifted(390, 200) + 90) < 1e-9);
  assert.ok(Math.abs(shifted(-390, 200) - 90) < 1e-9);
  assert.equal(shifted(390, 900), 0);
  assert.equal(shifted(500, 200), 0);
});
