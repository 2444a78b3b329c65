// Visitors in two browsers see each other where they are, each as large as they chose to be; and one follows.

import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { openBrowser } from "./browser.mjs";
import { enterRoom, HEADSET, outOfRoom, pictures, put } from "./emulated_headset.mjs";
import { open, show } from "./expect.mjs";

/** How far what one sees of another may be from where they are [m of that other]. */
const NEAR = 1e-3;
let opened;
let small;
let large;
let other;

before(async () => {
  opened = await open(["--mode", "live"], { width: 900, before: HEADSET });
  other = await openBrowser({ width: 900 });
  [small, large] = [opened.page, other.page];
  await large.addInitScript(HEADSET);
  await show(large, opened.served.url);
});

after(async () => {
  await other?.close();
  await opened?.close();
});

const enter = async (page, scale) => {
  await page.getByLabel("my size").selectOption(String(scale));
  await enterRoom(page, "enter VR");
  await page.getByRole("status").getByText("headset on").waitFor({ timeout: 240_000 });
};

/** Where a point of a visitor's own room is in the world (z up), as their page has it. */
const inWorld = async (page, point) => {
  const [x, y, z] = await page.evaluate((p) => window.seerob.visited(p), point);
  return [x, -z, y];
};

/** Where the headset has its right grip, in its visitor's room. */
const grip = (page) =>
  page.evaluate(async () => {
    const session = window.headset.activeSession;
    const space = await session.requestReferenceSpace("local-floor");
    return new Promise((done) => {
      session.requestAnimationFrame((_, frame) => {
        const right = [...session.inputSources].find(({ handedness }) => handedness === "right");
        const { x, y, z } = frame.getPose(right.gripSpace, space).transform.position;
        done([x, y, z]);
      });
    });
  });
const gripInWorld = async (page) => inWorld(page, await grip(page));

/** Wait until a page draws the other visitor's head and right hand where they are. */
async function sees(page, head, hand, near) {
  await page
    .waitForFunction(
      ([h, r, most]) => {
        const [one] = window.seerob.others;
        const far = (a, b) => (a ? Math.hypot(...a.map((v, i) => v - b[i])) : Infinity);
        window.off = one ? [far(one.head, h), far(one.right, r)] : null;
        return window.off !== null && Math.max(...window.off) <= most;
      },
      [head, hand, near],
      { timeout: 240_000 },
    )
    .catch(async (error) => {
      throw new Error(
        `off by ${await page.evaluate(() => window.off)} m, more than ${near}: ${error.message}`,
      );
    });
}

test("visitors at scales 1 and 10 see each other where they are", { timeout: 900_000 }, async () => {
  await Promise.all([enter(small, 1), enter(large, 10)]);
  const [head, hand] = [
    [0.3, 1.7, 0.2],
    [0.5, 1.2, -0.1],
  ];
  for (const page of [small, large]) {
    await put(page, head, hand, [0.2, -0.5, -1]);
    await pictures(page, 3);
  }
  assert.ok(
    Math.abs((await inWorld(small, head))[2] - 1.7) < 1e-6,
    "who is of this size stands on the floor",
  );
  assert.ok(Math.abs((await inWorld(large, head))[2] - 17) < 1e-5, "and who is ten times as large, too");
  await sees(large, await inWorld(small, head), await gripInWorld(small), NEAR);
  await sees(small, await inWorld(large, head), await gripInWorld(large), 10 * NEAR);
  const [seen] = await small.evaluate(() => window.seerob.others);
  assert.deepEqual([seen.scale, seen.device, seen.role], [10, "vr", "supervisor"]);
  assert.equal(seen.left !== null, true);
  // A step, and another size: both are seen.
  await put(large, [0.1, 1.5, 0], [0.4, 1, -0.3], [0, -1, -1]);
  await large.getByLabel("my size").selectOption("0.1");
  await pictures(large, 3);
  const now = [await inWorld(large, [0.1, 1.5, 0]), await gripInWorld(large)];
  assert.ok(Math.abs(now[0][2] - 0.15) < 1e-3);
  await sees(small, now[0], now[1], NEAR);
  assert.deepEqual([opened.browser.complaints, other.complaints], [[], []]);
});

test("who follows looks from where the other's head is, until they are gone", {
  timeout: 900_000,
}, async () => {
  await small.evaluate(() => window.headset.activeSession.end());
  await outOfRoom(small);
  await small.locator("details.company summary").click();
  await small.getByRole("button", { name: "follow", exact: true }).click();
  const [there] = await small.evaluate(() => window.seerob.others);
  // What is far ahead of that head is in the middle of the picture.
  const head = await inWorld(large, [0.1, 1.5, 0]);
  const ahead = await inWorld(large, [0.1, 1.5, -30]);
  assert.ok(there.head !== null && head.every(Number.isFinite));
  await small.waitForFunction(
    (p) => {
      const box = document.querySelector("canvas").getBoundingClientRect();
      const [x, y] = window.seerob.project(p);
      return Math.hypot(x - box.left - box.width / 2, y - box.top - box.height / 2) < 8;
    },
    ahead,
    { timeout: 240_000 },
  );
  await other.close();
  other = null;
  await small.waitForFunction(() => window.seerob.others.length === 0, null, { timeout: 240_000 });
  await small.locator("details.company").waitFor({ state: "detached", timeout: 240_000 });
});
