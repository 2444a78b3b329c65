// Every kind of marker is on the screen, where it should be, in its verdict's colour. What a marker changes
// is found by taking the same picture with its criterion's markers on and off.

import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { open, pixels, settled } from "./expect.mjs";

const COLORS = {
  within: [20, 170, 184],
  exceeded: [193, 21, 64],
  undecided: [252, 234, 146],
  none: [170, 182, 198],
};
const AROUND_PX = 16;
let opened;
let served;
let page;
let results;

before(async () => {
  opened = await open(["--mode", "replay", "--seconds", "8"], { width: 1280, height: 800 });
  ({ served, page } = opened);
  await page.keyboard.press("Shift+ArrowRight");
  await page.waitForFunction(() => Math.abs(window.seerob.t - 1) < 0.006);
  // Labels would lie over what is looked at.
  await page.getByRole("button", { name: "Overlays" }).click();
  await page.getByLabel("Labels of the worst three").uncheck();
  await page.getByRole("button", { name: "Overlays" }).click();
  const told = await served.tell(`snapshot ${await settled(page)}`);
  results = Object.fromEntries(told.results.map((result) => [result.name, result]));
});

after(() => opened?.close());

const marker = (criterion, type) => results[criterion].markers.find((m) => m.type === type);
const plus = (a, b, share = 1) => a.map((x, i) => x + share * b[i]);

/** Wait until the room has drawn what was asked for. */
const drawn = async () => {
  await page.evaluate(
    () =>
      new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => setTimeout(done, 100)))),
  );
  // As sharp as the screen, which is a moment later where pictures come slowly.
  await page.waitForFunction(() => {
    const { width, clientWidth } = document.querySelector(".room canvas");
    return width >= clientWidth;
  });
};

/** Pixels that the markers of a criterion change around a point of the world, with and without them. */
async function changed(criterion, point, around = AROUND_PX) {
  const [x, y] = await page.evaluate((p) => window.seerob.project(p), point);
  const clip = {
    x: Math.round(x) - around,
    y: Math.round(y) - around,
    width: 2 * around,
    height: 2 * around,
  };
  const key = String(Object.keys(results).indexOf(criterion) + 1);
  await drawn();
  const shown = await pixels(page, clip);
  await page.keyboard.press(key);
  await drawn();
  const without = await pixels(page, clip);
  await page.keyboard.press(key);
  const pairs = [];
  for (let i = 0; i < shown.length; i += 4) {
    const [a, b] = [shown.slice(i, i + 3), without.slice(i, i + 3)];
    if (distance(a, b) > 12) pairs.push([a, b]);
  }
  return pairs;
}

const distance = (a, b) => Math.hypot(...a.map((x, i) => x - b[i]));

async function assertDrawn(criterion, point, verdict) {
  const pairs = await changed(criterion, point);
  const color = COLORS[verdict ?? "none"];
  assert.ok(pairs.length >= 12, `${pairs.length} pixels changed`);
  const closer = pairs.filter(([shown, without]) => distance(shown, color) < distance(without, color));
  assert.ok(
    closer.length > 0.75 * pairs.length,
    `${closer.length} of ${pairs.length} pixels turned to ${verdict}`,
  );
}

test("a segment, along its length", async () => {
  const { start, end, verdict } = marker("separation", "segment");
  const along = end.map((x, i) => x - start[i]);
  for (const share of [0.3, 0.7]) await assertDrawn("separation", plus(start, along, share), verdict);
});

test("a sphere, at its rim", async () => {
  const { center, radius, verdict } = marker("separation", "sphere");
  await assertDrawn("separation", plus(center, [0, 0, 1], radius), verdict);
});

test("a highlight, on the body it names", async () => {
  const { verdict } = marker("separation", "highlight");
  const { center } = marker("separation", "sphere");
  await assertDrawn("separation", plus(center, [0.02, 0, 0]), verdict);
});

test("an area in the colour of a verdict can be seen through", async () => {
  const pairs = await changed("work area", [-0.3, -0.5, 1.2]);
  assert.ok(pairs.length > 200, `${pairs.length} pixels changed`);
  const solid = pairs.filter(([shown]) => distance(shown, COLORS.within) < 60);
  assert.ok(solid.length < 0.2 * pairs.length, `${solid.length} of ${pairs.length} pixels are opaque`);
});

test("what is inside a volume is not covered by it", async () => {
  const { poses } = await served.tell(`snapshot ${await settled(page)}`);
  const { center, size } = marker("work area", "box");
  const inside = Object.entries(poses).filter(
    ([name, at]) =>
      name.startsWith("ur10/") && at.slice(0, 3).every((x, i) => Math.abs(x - center[i]) < 0.4 * size[i]),
  );
  assert.ok(inside.length > 0);
  for (const [name, at] of inside) {
    const pairs = await changed("work area", at.slice(0, 3), 3);
    // An edge of the box may cross it.
    assert.ok(pairs.length < 0.4 * 6 ** 2, `${pairs.length} pixels changed on ${name}`);
  }
});

test("an arrow, on its shaft", async () => {
  const { origin, vector, verdict } = marker("tcp speed", "arrow");
  await assertDrawn("tcp speed", plus(origin, vector, 0.7), verdict);
});

test("an ellipsoid, at the end of its longest axis", async () => {
  const { center, wxyz, radii, verdict } = marker("manipulability", "ellipsoid");
  const [w, x, y, z] = wxyz;
  const first = [1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)];
  await assertDrawn("manipulability", plus(center, first, radii[0]), verdict);
});

test("a box, at its corners", async () => {
  const { center, size, verdict } = marker("work area", "box");
  await assertDrawn("work area", plus(center, size, 0.5), verdict);
  await assertDrawn("work area", plus(center, [size[0], size[1], -size[2]], 0.5), verdict);
});

test("a hull, on its surface, hatched where it is undecided", async () => {
  const { vertices, verdict } = marker("work area", "hull");
  assert.equal(verdict, "undecided");
  const foot = [0, 1, 2].map((i) => (vertices[0][i] + vertices[1][i] + vertices[2][i]) / 3);
  const apex = vertices[3];
  const middle = foot.map((x, i) => apex[i] + 0.3 * (x - apex[i]));
  await page.getByRole("button", { name: "Top", exact: true }).click();
  const pairs = await changed("work area", middle);
  await page.getByRole("button", { name: "3D", exact: true }).click();
  const yellow = pairs.map(([[r, , b], [r0, , b0]]) => r - b - (r0 - b0));
  const strong = yellow.filter((x) => x > 8).length;
  assert.ok(strong > 20, `${strong} pixels turned yellow`);
  assert.ok(
    Math.max(...yellow) > 3 * Math.max(1, yellow.sort((a, b) => a - b)[yellow.length >> 3]),
    "no hatch",
  );
});

test("a polyline, on its legs, closed where it says so", async () => {
  const { points, verdict } = marker("scanner", "polyline");
  const middle = (a, b) => a.map((x, i) => (x + b[i]) / 2);
  await page.getByRole("button", { name: "Top", exact: true }).click();
  await assertDrawn("scanner", middle(points[0], points[1]), verdict);
  await assertDrawn("scanner", middle(points[3], points[0]), verdict);
  await page.getByRole("button", { name: "3D", exact: true }).click();
});

test("a concave prism fills what it encloses and not its notch", async () => {
  const { verdict } = marker("scanner", "prism");
  await page.getByRole("button", { name: "Top", exact: true }).click();
  await assertDrawn("scanner", [-1.2, -0.75, 0.5], verdict);
  const notch = await changed("scanner", [-1.2, 0.12, 0.5]);
  await page.getByRole("button", { name: "3D", exact: true }).click();
  // Only edges far below may cross it: the whole picture would change if it were filled.
  assert.ok(notch.length < 0.2 * (2 * AROUND_PX) ** 2, `${notch.length} pixels changed in the notch`);
});

test("rays: what hits is strong, what passes is faint, and the fan between them is filled", async () => {
  const { starts, ends, hits, verdict } = marker("scanner", "rays");
  await page.getByRole("button", { name: "Top", exact: true }).click();
  const along = (k) => ends[k].map((x, i) => starts[0][i] + 0.6 * (x - starts[0][i]));
  const redness = async (k) => {
    const pairs = await changed("scanner", along(k));
    assert.ok(pairs.length > 100, `${pairs.length} pixels changed`);
    const gains = pairs.map(([[r, g], [r0, g0]]) => r - g - (r0 - g0)).sort((a, b) => b - a);
    return gains[20];
  };
  assert.equal(verdict, "exceeded");
  const [hit, pass] = [await redness(hits[1]), await redness(3)];
  await page.getByRole("button", { name: "3D", exact: true }).click();
  assert.ok(hit > 1.5 * pass, `${hit} for a hit, ${pass} for none`);
});

test("a label is written, as text whatever it says", async () => {
  const { position } = marker("work area", "label");
  const pairs = await changed("work area", plus(position, [0, 0, 0.05]));
  const bright = pairs.filter(([shown]) => Math.min(...shown) > 150).length;
  assert.ok(bright > 30 && bright < 600, `${bright} pixels of letters`);
  assert.equal(await page.evaluate(() => globalThis.hacked), undefined);
});

test("figures are written at the sides of the room; in its middle there are only lines to them", async () => {
  const labels = async (on) => {
    await page.getByRole("button", { name: "Overlays" }).click();
    await page.getByLabel("Labels of the worst three").setChecked(on);
    await page.getByRole("button", { name: "Overlays" }).click();
    await drawn();
    return pixels(page, room);
  };
  const room = await page.locator(".room").boundingBox();
  const [without, written] = [await labels(false), await labels(true)];
  await labels(false);
  const [width, height] = [Math.round(room.width), Math.round(room.height)];
  const counts = [0, 0, 0];
  for (let i = 0; i < written.length; i += 4) {
    const differs = distance(written.slice(i, i + 3), without.slice(i, i + 3)) > 12;
    if (differs) counts[Math.floor((3 * ((i / 4) % width)) / width)] += 1;
  }
  const [left, middle, right] = counts;
  assert.ok(left + right > 2000, `${counts}`);
  assert.ok(middle < 0.02 * ((width * height) / 3), `${middle} pixels in the middle`);
});

test("markers vanish while nothing is known", async () => {
  const { center, size } = marker("work area", "box");
  const hand = marker("separation", "sphere");
  const painted = async () => {
    const [x, y] = await page.evaluate((p) => window.seerob.project(p), plus(hand.center, [0.02, 0, 0]));
    const [r, g, b] = await pixels(page, { x: Math.round(x), y: Math.round(y), width: 1, height: 1 });
    return distance([r, g, b], COLORS[hand.verdict]);
  };
  const shown = await painted();
  await served.tell("stop");
  await page.waitForSelector(".pill.state-off");
  await drawn();
  assert.ok((await painted()) > shown + 30, "a body keeps the colour of a verdict");
  assert.deepEqual(await changed("work area", plus(center, size, 0.5)), []);
});
