// Without a graphics card: as little is drawn as can be, and only what is new.

import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { open, settled } from "./expect.mjs";
import { load } from "./source.mjs";

const { Sharpness } = await load("scene/effort");
let opened;
let page;

// Runs in the page: what is handed to WebGL, by canvas that is in the page.
const watch = () => {
  const seen = { sources: [], pictures: 0 };
  window.seen = seen;
  const gl = WebGL2RenderingContext.prototype;
  const { shaderSource, clear } = gl;
  gl.shaderSource = function (shader, source) {
    seen.sources.push(source);
    return shaderSource.call(this, shader, source);
  };
  gl.clear = function (mask) {
    seen.pictures += 1;
    return clear.call(this, mask);
  };
};

before(async () => {
  opened = await open(["--mode", "replay", "--seconds", "4"], { before: watch });
  page = opened.page;
});

after(() => opened?.close());

test("no light is worked out per pixel, no shadow and no floor for one is drawn", async () => {
  const sources = await page.evaluate(() => window.seen.sources);
  assert.ok(sources.length > 4);
  // In three's shaders: whoever is lit or shadowed at pixels has one of these.
  const lit = sources.filter((source) => /RE_Direct\s*\(|getShadowMask\s*\(\s*\)\s*\)/.test(source));
  assert.deepEqual(lit, []);
  assert.ok(sources.some((source) => source.includes("vLight")));
});

test("while nothing changes nothing is drawn", async () => {
  await settled(page);
  // A blurred picture is drawn once more; a loaded machine takes its time for that.
  const drawn = () => page.evaluate(() => window.seen.pictures);
  let before = -1;
  for (let again = 0, now = await drawn(); now !== before; again += 1) {
    assert.ok(again < 60, "it draws on");
    before = now;
    await page.waitForTimeout(1000);
    now = await drawn();
  }
  await page.keyboard.press("Shift+ArrowRight");
  await page.waitForFunction((n) => window.seen.pictures > n, before);
});

/** Pictures whose time follows from their pixels, at a rate of `fixed` [ms] for none and `full` for all. */
function run(sharpness, fixed, full, pictures) {
  let time = 0;
  for (let i = 0; i < pictures; i += 1) {
    const took = fixed + full * sharpness.ratio ** 2;
    time += took;
    sharpness.take(took, time);
  }
  return sharpness.ratio;
}

test("pixels get larger until pictures come in time, never below what can be read, and smaller again", () => {
  const sharpness = new Sharpness(1, 0.6, 24);
  assert.equal(run(sharpness, 5, 20, 100), 1);
  const less = run(sharpness, 5, 60, 100);
  assert.ok(less < 1 && less >= 0.6 && 5 + 60 * less ** 2 < 1000 / 24, `${less}`);
  assert.equal(run(sharpness, 5, 600, 200), 0.6);
  assert.equal(run(sharpness, 5, 10, 200), 1);
});

test("where something else is slow, the picture stays sharp", () => {
  const sharpness = new Sharpness(1, 0.6, 24);
  let sharp = 0;
  for (let i = 0; i < 400; i += 1) {
    sharpness.take(200, i * 200);
    if (sharpness.ratio === 1) sharp += 1;
  }
  assert.ok(sharp > 300, `${sharp} of 400 pictures were sharp`);
});
