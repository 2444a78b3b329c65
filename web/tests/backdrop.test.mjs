// What stands still is drawn once while one looks from one place, and looks as if it were drawn at every picture.

import assert from "node:assert/strict";
import fs from "node:fs";
import os from "node:os";
import path from "node:path";
import { after, before, test } from "node:test";
import { openBrowser } from "./browser.mjs";
import { edited, showEdited } from "./edited.mjs";

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
const compared = () =>
  browser.page.evaluate(async () => {
    let kept = window.seerob.picture(false);
    while (!window.seerob.keeps) {
      await new Promise(requestAnimationFrame);
      for (let k = 0; k < 3; k += 1) kept = window.seerob.picture(false);
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
