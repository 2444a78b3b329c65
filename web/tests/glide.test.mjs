// Bodies between two heard frames: on the way, never beyond, and exactly there in the end.

import assert from "node:assert/strict";
import { test } from "node:test";
import { load } from "./source.mjs";

const { blend, Glide } = await load("glide");

const at = (x, half = 0) => Float32Array.from([x, 0, 0, Math.cos(half), 0, 0, Math.sin(half)]);

function take(glide, block, t, now, drawnEvery) {
  glide.drawnEvery = drawnEvery;
  glide.take(block, { t }, now);
}

test("the first frame, a jump and a frame after a pause are shown at once", () => {
  const glide = new Glide();
  assert.equal(glide.at(0), null);
  take(glide, at(1), 0, 0, 4);
  assert.deepEqual(glide.at(0), at(1));
  take(glide, at(2), 5, 16, 4); // 5 s further in run time
  assert.deepEqual(glide.at(16), at(2));
  take(glide, at(3), 4.99, 32, 4); // backwards
  assert.deepEqual(glide.at(32), at(3));
  take(glide, at(4), 5.0, 1000, 4); // a second later
  assert.deepEqual(glide.at(1000), at(4));
  assert.equal(glide.moving, false);
});

test("a frame is reached after the time that it took to come, bit for bit", () => {
  const glide = new Glide();
  take(glide, at(0), 0, 0, 4);
  take(glide, at(0.2, 0.3), 0.03, 40, 4);
  assert.equal(glide.moving, true);
  assert.equal(glide.at(40)[0], 0);
  assert.ok(Math.abs(glide.at(60)[0] - 0.1) < 1e-6);
  assert.deepEqual(glide.at(80), at(0.2, 0.3));
  assert.equal(glide.moving, false);
  assert.deepEqual(glide.at(500), at(0.2, 0.3)); // nothing is extrapolated
});

test("a frame that comes early goes on from what the eye sees", () => {
  const glide = new Glide();
  take(glide, at(0), 0, 0, 4);
  take(glide, at(0.2), 0.02, 40, 4);
  assert.ok(Math.abs(glide.at(50)[0] - 0.05) < 1e-6);
  take(glide, at(0.4), 0.04, 50, 4);
  assert.ok(Math.abs(glide.at(50)[0] - 0.05) < 1e-6);
  assert.deepEqual(glide.at(60), at(0.4));
});

test("who leaps is nowhere in between, and neither is what is seen with them", () => {
  const glide = new Glide();
  const two = (a, b) => Float32Array.from([...at(a), ...at(b)]);
  take(glide, two(0, 0), 0, 0, 4);
  take(glide, two(5, 0.01), 0.04, 40, 4);
  assert.deepEqual(glide.at(41), two(5, 0.01));
  take(glide, two(5.1, 0.02), 0.08, 80, 4);
  assert.equal(glide.moving, true);
});

test("where frames come as often as pictures are drawn nothing is delayed", () => {
  const glide = new Glide();
  take(glide, at(0), 0, 0, 16);
  take(glide, at(1), 0.016, 16, 16);
  assert.deepEqual(glide.at(16), at(1));
  assert.equal(glide.moving, false);
});

test("a block of another length begins anew", () => {
  const glide = new Glide();
  take(glide, at(0), 0, 0, 4);
  take(glide, Float32Array.from([...at(1), ...at(2)]), 0.01, 16, 4);
  assert.equal(glide.at(16).length, 14);
});

test("orientations stay unit quaternions on the shorter arc, whatever their sign", () => {
  const out = new Float32Array(7);
  const [from, to] = [at(0, 0.1), at(0, 0.5)];
  for (const sign of [1, -1]) {
    blend(
      from,
      to.map((x, i) => (i < 3 ? x : sign * x)),
      { share: 0.5 },
      out,
    );
    assert.ok(Math.abs(Math.hypot(...out.slice(3)) - 1) < 1e-6);
    // Half way between turns of 0.2 and 1.0 rad is one of 0.6 rad.
    assert.ok(Math.abs(Math.abs(out[3]) - Math.cos(0.3)) < 1e-6);
    assert.ok(Math.abs(Math.abs(out[6]) - Math.sin(0.3)) < 1e-6);
  }
});
