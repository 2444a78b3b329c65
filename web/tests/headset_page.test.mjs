// The page in an emulated headset: into the room by a button, around in it, and out again as one came.

import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { enterRoom, HEADSET, outOfRoom, pictures, pressInRoom, put } from "./emulated_headset.mjs";
import { frames, open, pixels } from "./expect.mjs";

const NEAR = 1e-3;
let opened;
let browser;
let page;

before(async () => {
  opened = await open(["--mode", "live"], { width: 1280, before: HEADSET });
  ({ browser, page } = opened);
});

after(() => opened?.close());

const press = (name) => enterRoom(page, name);
const visited = (point) => page.evaluate((p) => window.seerob.visited(p), point);
const leave = async () => {
  await page.evaluate(() => window.headset.activeSession.end());
  await outOfRoom(page);
};
const push = (side, x, y) =>
  page.evaluate(([s, a, b]) => window.headset.controllers[s].updateAxes("thumbstick", a, b), [side, x, y]);
const close = (found, expected, name) => {
  const off = Math.hypot(...found.map((v, i) => v - expected[i]));
  assert.ok(off < NEAR, `${name}: ${found} instead of ${expected}`);
};

test("who looks stands where the page looked from, turns and goes, and comes back to it", async () => {
  const shown = () => page.evaluate(() => window.seerob.project([0.4, 0.2, 0.9]));
  // Everything is in view only when everything is there.
  await page.waitForFunction(() => window.seerob.pose("operator/head") !== null);
  let seen = await shown();
  for (let before = null; String(before) !== String(seen); seen = await shown()) {
    before = seen;
    await frames(page, 30);
  }
  await press("enter VR");
  await page.getByRole("status").getByText("headset on").waitFor({ timeout: 240_000 });
  await put(page, [0.3, 1.7, 0.2], [0.3, 1.2, 0.2], [0, -1, -1]);
  await pictures(page, 3);
  const head = await visited([0.3, 1.7, 0.2]);
  assert.ok(Math.abs(head[1] - 1.7) < NEAR, "one stands on the floor");
  const ahead = async () => {
    const [from, to] = [await visited([0.3, 1.7, 0.2]), await visited([0.3, 1.7, -0.8])];
    return to.map((v, i) => v - from[i]);
  };
  const before = await ahead();
  await push("right", 1, 0);
  await pictures(page, 3);
  close(await visited([0.3, 1.7, 0.2]), head, "the head stays where it is in a turn");
  const [cos, sin] = [Math.cos(Math.PI / 6), Math.sin(Math.PI / 6)];
  const turned = [before[0] * cos - before[2] * sin, 0, before[0] * sin + before[2] * cos];
  close(await ahead(), turned, "30 degrees to the right, once");
  await push("right", 0, 0);
  await pictures(page, 2);
  // The hand is 1.2 m high and points down by 45 degrees: 1.2 m ahead of it.
  const landing = await visited([0.3, 0, -1.0]);
  await push("right", 0, -1);
  await pictures(page, 3);
  await push("right", 0, 0);
  await pictures(page, 3);
  close(await visited([0.3, 0, 0.2]), landing, "one stands where one pointed");
  await leave();
  assert.equal(await page.evaluate(() => window.seerob.visited([0, 0, 0])), null);
  await page.waitForFunction(
    ([x, y]) => {
      const [a, b] = window.seerob.project([0.4, 0.2, 0.9]);
      return Math.hypot(a - x, b - y) < 0.5;
    },
    seen,
    { timeout: 240_000 },
  );
  assert.deepEqual(browser.complaints, []);
});

test("what one points at is selected with the trigger", async () => {
  await press("enter VR");
  await pictures(page, 4);
  const at = await page.evaluate(() => window.seerob.pose("table").position);
  const [floor, right, back] = await Promise.all([
    visited([0, 0, 0]),
    visited([1, 0, 0]),
    visited([0, 0, 1]),
  ]);
  const off = at.map((v, i) => v - floor[i]);
  const along = (to) => to.reduce((sum, v, i) => sum + (v - floor[i]) * off[i], 0);
  const inRoom = [along(right), off[1], along(back)];
  // From above the table, straight down; the robot or what it carries may be over it just then.
  await put(page, [0, 1.6, 0], [inRoom[0], 2.6, inRoom[2]], [0, -1, 0]);
  await pictures(page, 4);
  await page.evaluate(() => window.headset.controllers.right.updateButtonValue("trigger", 1));
  await pictures(page, 4);
  await page.evaluate(() => window.headset.controllers.right.updateButtonValue("trigger", 0));
  await pictures(page, 4);
  // Nobody in the room sees panels: none of them is drawn until one is back.
  assert.equal(await page.locator(".criteria, .plots, .properties h2, output.pill").count(), 0);
  await leave();
  await page.locator(".properties h2").waitFor({ timeout: 240_000 });
});

const pressIn = (label) => pressInRoom(page, label, [0, 1.2, 0]);

test("the menu at the wrist raises who sits, changes hands and ends the visit", async () => {
  await press("enter VR");
  await put(page, [0, 1.2, 0]);
  await page.evaluate(() => window.put(1, [-0.2, 1.0, -0.5]));
  await pictures(page, 5);
  const eyes = async () => (await visited([0, 1.2, 0]))[1];
  const low = await eyes();
  await pressIn("seated");
  assert.ok(Math.abs((await eyes()) - low - 0.4) < 2e-3, `eyes are raised from ${low} to ${await eyes()}`);
  await pressIn("seated");
  assert.ok(Math.abs((await eyes()) - low) < 1e-6);
  await pressIn("ghost");
  await pressIn("plot");
  // Drawn from what feeds the panel of the page.
  await pressIn("body map");
  // What stands on them is what was drawn: verdict, criteria with what is open, the plot's title.
  await page.waitForFunction(() => {
    const { panels } = window.seerob;
    const has = (...words) => words.every((one) => panels.some((line) => line.includes(one)));
    return (
      /run:/.test(panels[0]) && has("effective mass", "mass of ur10/shoulder_link was given by nobody", "[")
    );
  });
  await pressIn("plot");
  await page.waitForFunction(() => !window.seerob.panels.some((line) => / \[.+\]$/.test(line)));
  await pressIn("plot");
  assert.equal(await page.evaluate(() => localStorage.getItem("xr.seated")), "off");
  await pressIn("leave");
  await outOfRoom(page);
  assert.deepEqual(browser.complaints, []);
});

/** Pixels of buttons that are on. */
async function lit() {
  const data = await pixels(page);
  let count = 0;
  for (let i = 0; i < data.length; i += 4)
    if (Math.hypot(data[i] - 0x14, data[i + 1] - 0x65, data[i + 2] - 0x6e) < 12) count += 1;
  return count;
}

test("a section cuts the twin and not the menu; hands feel what is pressed and what begins to be exceeded", async () => {
  await press("enter VR");
  await page.evaluate(() => {
    window.felt = [];
    for (const { gamepad } of window.headset.activeSession.inputSources)
      for (const each of gamepad.hapticActuators) each.pulse = (...told) => void window.felt.push(told);
  });
  await put(page, [0, 1.2, 0]);
  await page.evaluate(() => window.put(1, [-0.2, 0.9, -0.4]));
  await pictures(page, 5);
  const before = await lit();
  await pressIn("section");
  await pictures(page, 12);
  const cut = await lit();
  // Areas behind the menu have about that colour too, and move.
  assert.ok(cut > 1.1 * before, `${cut} pixels of buttons that are on, ${before} before`);
  assert.ok((await page.evaluate(() => window.felt)).some(([strength, ms]) => strength === 0.3 && ms === 40));
  await pressIn("section");
  await pictures(page, 12);
  assert.ok((await lit()) < 0.95 * cut, "off again");
  // The run of this cell goes beyond a limit every now and then.
  await page.waitForFunction(() => window.felt.some(([strength, ms]) => strength === 0.7 && ms === 150));
  await leave();
  assert.deepEqual(browser.complaints, []);
});

test("bare hands have the menu at their wrist, and a pinch presses it", async () => {
  await press("enter VR");
  await put(page, [0, 1.2, 0]);
  const from = [0.25, 1.3, 0];
  await page.evaluate((at) => {
    const { hands } = window.headset;
    window.headset.primaryInputMode = "hand";
    hands.left.position.set(-0.2, 0.9, -0.4);
    hands.right.position.set(...at);
  }, from);
  await pictures(page, 5);
  const eyes = async () => (await visited([0, 1.2, 0]))[1];
  const low = await eyes();
  await page.evaluate((at) => {
    const [x, y, z] = window.seerob.inRoom(window.seerob.button("seated")).map((v, i) => v - at[i]);
    // From -z to there: half way between both.
    const far = Math.hypot(x, y, z);
    const turn = [y / far, -x / far, 0, 1 - z / far];
    const long = Math.hypot(...turn);
    window.headset.hands.right.quaternion.set(...turn.map((v) => v / long));
  }, from);
  await pictures(page, 3);
  const pinch = async (value) => {
    await page.evaluate((v) => window.headset.hands.right.updatePinchValue(v), value);
    await pictures(page, 2);
  };
  await pinch(1);
  await pinch(0);
  assert.ok(Math.abs((await eyes()) - low - 0.4) < 2e-3, `eyes are raised from ${low} to ${await eyes()}`);
  await pinch(1);
  await pinch(0);
  assert.ok(Math.abs((await eyes()) - low) < 1e-6);
  await page.evaluate(() => {
    window.headset.primaryInputMode = "controller";
  });
  await leave();
});

test("whoever is a person offers what the headset sees, and hears when nothing waits for it", async () => {
  await press("be operator in VR");
  const answer = page.getByText("nothing in this run waits for a headset of 'operator'");
  await answer.waitFor({ timeout: 240_000 });
  await leave();
  assert.deepEqual([browser.complaints, browser.outside], [[], []]);
});

test("through the glasses the room has no background of its own, and what is real is not drawn", async () => {
  const occluding = () =>
    page.evaluate(() => ["table", "line/fixture/pin_1"].filter((name) => window.seerob.occludes(name)));
  assert.deepEqual(await occluding(), [], "in a room of its own the twin is drawn as a whole");
  await press("enter AR");
  await pictures(page, 2);
  const mode = await page.evaluate(() => window.headset.activeSession.environmentBlendMode);
  assert.equal(mode, "alpha-blend");
  assert.deepEqual(await occluding(), ["table"]);
  await leave();
  assert.deepEqual(await occluding(), []);
  assert.deepEqual(browser.complaints, []);
});
