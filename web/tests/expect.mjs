// What the tests compare with, and how they wait for it.

import assert from "node:assert/strict";
import { openBrowser } from "./browser.mjs";
import { serve } from "./served.mjs";

/** A pose of the wire (z up; x, y, z, w, x, y, z) as three.js must have it (y up; quaternion x, y, z, w). */
export function turned([x, y, z, qw, qx, qy, qz]) {
  // Minus 90 degrees about x: (x, y, z) becomes (x, z, −y); its quaternion is (c, −c, 0, 0), c = √½.
  const c = Math.SQRT1_2;
  const w = c * (qw + qx);
  return {
    position: [x, z, -y],
    quaternion: [c * (qx - qw), c * (qy + qz), c * (qz - qy), w],
  };
}

/** Fail unless two poses are the same up to float32 and to the sign of the quaternion. */
export function assertSamePose(actual, expected, name) {
  const near = (a, b) => a.every((x, i) => Math.abs(x - b[i]) < 2e-6);
  const same =
    near(actual.position, expected.position) &&
    (near(actual.quaternion, expected.quaternion) ||
      near(
        actual.quaternion.map((x) => -x),
        expected.quaternion,
      ));
  assert.ok(same, `${name}: ${JSON.stringify(actual)} instead of ${JSON.stringify(expected)}`);
}

/**
 * A server and a page that shows something of it; they start side by side.
 *
 * @param {string[]} options Options of serve.py, such as "--mode", "replay".
 * @param view Size of the window, and `before`: what runs in the page before its own code.
 */
export async function open(options, { before, ...size } = {}) {
  const [served, browser] = await Promise.all([serve(...options), openBrowser(size)]);
  const { page } = browser;
  if (before) await page.addInitScript(before);
  await show(page, served.url);
  const close = () => Promise.all([browser.close(), served.close()]);
  return { served, browser, page, close };
}

/** Open the page and wait until it shows something. */
export async function show(page, url) {
  await page.goto(url);
  await page.waitForFunction(() => Number.isFinite(window.seerob?.t));
  await page.waitForSelector("tr[data-criterion]");
}

/** Wait until a page has drawn so many pictures. */
export function frames(page, count) {
  return page.evaluate(
    (n) =>
      new Promise((done) => {
        const each = () => (n-- > 0 ? requestAnimationFrame(each) : done());
        each();
      }),
    count,
  );
}

/**
 * Wait until the shown run time stays the same, and return it.
 *
 * That says something only while the page draws and its server answers: on a loaded machine either may do nothing
 * for a second.
 */
export async function settled(page) {
  let before = Number.NaN;
  for (;;) {
    const t = await page.evaluate(() => window.seerob.t);
    if (t === before) return t;
    before = t;
    await page.waitForTimeout(200);
    await page.evaluate(async () => (await fetch(location.pathname, { cache: "no-store" })).text());
    await frames(page, 5);
  }
}

/** Poses of some bodies as drawn. */
export function poses(page, names) {
  return page.evaluate(
    (all) => Object.fromEntries(all.map((name) => [name, window.seerob.pose(name)])),
    names,
  );
}

/**
 * Fail unless every body is where the snapshot of the shown run time has it, or comes there.
 *
 * @param t That run time, as far as is known: what was played may still be on its way to a loaded machine.
 */
export async function assertShown(page, served, t) {
  const told = await served.tell(`snapshot ${t}`);
  assert.ok(Math.abs(told.t - t) < 1e-9);
  const names = Object.keys(told.poses);
  const expected = Object.fromEntries(names.map((name) => [name, turned(told.poses[name])]));
  // Bodies glide there; a loaded machine draws seldom.
  await page
    .waitForFunction(
      ([all, at]) =>
        window.seerob.t !== at ||
        Object.entries(all).every(([name, pose]) => {
          const { position } = window.seerob.pose(name);
          return position.every((x, i) => Math.abs(x - pose.position[i]) < 2e-6);
        }),
      [expected, t],
    )
    .catch(() => {}); // what differs is said below
  const drawn = await poses(page, names);
  const later = await settled(page);
  if (later !== t) return assertShown(page, served, later);
  for (const [name, pose] of Object.entries(told.poses)) assertSamePose(drawn[name], turned(pose), name);
  return told;
}

/** Pixels of a part of the screen: width, height and RGBA bytes. */
export async function pixels(page, clip) {
  const png = (await page.screenshot({ clip })).toString("base64");
  // As one text: numbers by the million take a browser half a minute to hand over.
  const bytes = await page.evaluate(async (data) => {
    const image = new Image();
    image.src = `data:image/png;base64,${data}`;
    await image.decode();
    const canvas = new OffscreenCanvas(image.width, image.height);
    const brush = canvas.getContext("2d");
    brush.drawImage(image, 0, 0);
    const { data: colors } = brush.getImageData(0, 0, image.width, image.height);
    let text = "";
    for (let i = 0; i < colors.length; i += 8192)
      text += String.fromCharCode(...colors.subarray(i, i + 8192));
    return btoa(text);
  }, png);
  return [...Buffer.from(bytes, "base64")];
}
