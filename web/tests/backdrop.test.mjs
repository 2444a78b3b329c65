// What stands still is drawn once while one looks from one place, and looks as if it were drawn at every picture: fewer
// than one pixel in 10⁴ is off by more than 2 of 255.

import assert from "node:assert/strict";
import fs from "node:fs";
import os from "node:os";
import path from "node:path";
import { createInterface } from "node:readline";
import { after, before, test } from "node:test";
import { fileURLToPath } from "node:url";
import { openBrowser } from "./browser.mjs";
import { edited, showEdited } from "./edited.mjs";
import { python } from "./python.mjs";

const folder = fs.mkdtempSync(path.join(os.tmpdir(), "seerob-backdrop-"));
const row = (k) =>
  `[[parts]]\nname = "ball_${k}"\nshape = { sphere = 0.1 }\n` +
  `at = { position = [${(k % 24) * 0.3}, ${Math.floor(k / 24) * 0.3}, 0.1] }\n`;
const arm = `[[robots]]\nname = "arm"\nmodel = "library:ur5e"\nbase = { position = [1.65, 1.65, 0] }\n`;

let browser;
let station;

before(async () => {
  fs.writeFileSync(
    path.join(folder, "workstation.toml"),
    [arm, ...Array.from({ length: 600 }, (_, k) => row(k))].join("\n"),
  );
  station = await edited(folder);
  browser = await openBrowser({ width: 900, height: 700 });
  await showEdited(browser.page, `${station.url}${station.url.includes("?") ? "&" : "?"}draw=light`);
});

after(async () => {
  await browser?.close();
  await station?.close();
  fs.rmSync(folder, { recursive: true, force: true });
});

/** As soon as something is kept: share of pixels that differ, between the picture with what is kept and one drawn anew in the same task. */
const compared = (page = browser.page) =>
  page.evaluate(async () => {
    let kept;
    for (;;) {
      await new Promise(requestAnimationFrame);
      kept = window.seerob.picture(false);
      if (window.seerob.keeps) break;
      await kept;
    }
    const anew = window.seerob.picture(true);
    const pixels = async (bytes) => {
      const image = await createImageBitmap(new Blob([new Uint8Array(await bytes)]));
      const context = new OffscreenCanvas(image.width, image.height).getContext("2d");
      context.drawImage(image, 0, 0);
      return context.getImageData(0, 0, image.width, image.height).data;
    };
    const [one, other] = [await pixels(kept), await pixels(anew)];
    let different = Math.abs(one.length - other.length);
    const colors = new Set();
    for (let k = 0; k < other.length; k += 4) {
      const at = [0, 1, 2].map((j) => other[k + j]);
      colors.add(at.join(" "));
      if (at.some((value, j) => Math.abs(value - one[k + j]) > 2)) different += 1;
    }
    return { share: (4 * different) / other.length, colors: colors.size };
  });

test("a picture with what is kept is the one that is drawn anew, before, behind and beside it", async () => {
  const { page } = browser;
  const first = await compared();
  assert.ok(first.colors > 50, JSON.stringify(first));
  assert.ok(first.share < 1e-4, JSON.stringify(first));
  // From elsewhere it is another picture, which is kept in its turn.
  const box = await page.locator("canvas").first().boundingBox();
  const [x, y] = [box.x + box.width / 2, box.y + box.height / 2];
  await page.mouse.move(x, y);
  await page.mouse.down();
  await page.mouse.move(x + 90, y - 20, { steps: 5 });
  await page.mouse.up();
  await page.mouse.move(2, 2);
  const second = await compared();
  assert.ok(second.share < 1e-4, JSON.stringify(second));
});

test("who is hidden, or looks different, is so at once", async () => {
  const { page } = browser;
  const before = await page.evaluate(() => window.seerob.picture(false));
  await page.getByRole("button", { name: "Hide ball_2", exact: true }).click();
  await page.mouse.move(2, 2);
  assert.notDeepEqual(await page.evaluate(() => window.seerob.picture(false)), before);
  const kept = await compared();
  assert.ok(kept.share < 1e-4, JSON.stringify(kept));
  assert.deepEqual(browser.complaints, []);
});

test("beside an arm that moves nothing is seen where it was: colours, cuts, size and a lost graphics card change all", async () => {
  const cell = path.join(folder, "moving");
  const motion = fileURLToPath(new URL("../../workstations/guarded_cell/motion", import.meta.url));
  fs.cpSync(motion, path.join(cell, "motion"), { recursive: true });
  const source = `[[sources]]\nkind = "csv"\nrobot = "arm"\nfile = "motion/cycle.csv"\nloop = true\nloop_pause = 0.02\n`;
  const balls = Array.from({ length: 600 }, (_, k) => row(k));
  fs.writeFileSync(path.join(cell, "workstation.toml"), [arm, source, ...balls].join("\n"));
  const run = python("-m", "seerob", "run", cell, "--port", "0", "--no-record", "--allow-outside");
  const ended = new Promise((resolve) => run.once("exit", resolve));
  let url;
  for await (const line of createInterface({ input: run.stdout })) {
    url = line.match(/http:\/\/\S+/)?.[0];
    if (url) break;
  }
  run.stdout.resume();
  const { page, complaints, close } = await openBrowser({ width: 1300, height: 900 });
  await page.goto(`${url}${url.includes("?") ? "&" : "?"}draw=light`);
  await page.waitForFunction(() => window.seerob?.pose("arm/wrist_3_link") != null);
  const hand = () => page.evaluate(() => window.seerob.pose("arm/wrist_3_link").position);
  const alike = async (what) => {
    const before = await hand();
    for (let k = 0; k < 4; k += 1) {
      const { share, colors } = await compared(page);
      assert.ok(colors > 50 && share < 1e-4, `${what}: ${share}, ${colors}`);
      await page.waitForTimeout(250);
    }
    assert.notDeepEqual(await hand(), before);
  };
  await alike("moving");
  await page.evaluate(async () => {
    const canvas = document.querySelector("canvas");
    const card = canvas.getContext("webgl2").getExtension("WEBGL_lose_context");
    const told = (name) => new Promise((resolve) => canvas.addEventListener(name, resolve, { once: true }));
    const lost = told("webglcontextlost");
    card.loseContext();
    await lost;
    await new Promise((resolve) => setTimeout(resolve)); // allowed once all were told
    const restored = told("webglcontextrestored");
    card.restoreContext();
    await restored;
  });
  await alike("another graphics card");
  await page.getByRole("button", { name: "View", exact: true }).click();
  await page.locator(".view-panel").getByLabel("Section").selectOption("x");
  await alike("cut");
  await page.locator(".view-panel").getByLabel("Section").selectOption("no section");
  await page.emulateMedia({ colorScheme: "light" });
  await alike("light");
  await page.setViewportSize({ width: 1100, height: 800 });
  await alike("smaller");
  assert.deepEqual(complaints, []);
  await close();
  run.kill("SIGINT");
  await ended;
});
