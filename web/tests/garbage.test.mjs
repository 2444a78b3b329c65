// A picture in the room allocates nothing, neither of the page's own nor of three.js's as the page has it
// (three_garbage.ts): bodies, markers and captions that move, on the desk and in an emulated headset, drawn as without and
// as with a graphics card.

import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { openBrowser } from "./browser.mjs";
import { enterRoom, HEADSET, pictures, put } from "./emulated_headset.mjs";
import { allocated, COMPILED, hold, most, pass, WRAPPED } from "./garbage.mjs";
import { serve } from "./served.mjs";

/** Ten numbers with a fraction, each an object of twelve; beside busy processes the measurement finds some by chance [B]. */
const FEW = 120;
const FURTHER = 28;
// What is drawn does not matter here, and takes the longest.
const UNDRAWN = `
for (const key of ["drawElements", "drawArrays", "drawElementsInstanced", "drawArraysInstanced", "clear", "blitFramebuffer"])
  WebGL2RenderingContext.prototype[key] = () => {};`;

let served;

before(async () => {
  served = await serve("--mode", "live", "--seconds", "3600", "--further", String(FURTHER));
});

after(async () => {
  await served?.close();
});

/** Stretches of 100 pictures until V8 has compiled the last function: what it had merged into another begins anew. */
const MOST = 50;

/** What every picture allocates is there in two stretches that follow each other; what is compiled meanwhile is in one. */
function inBoth(one, other) {
  const by = new Map([...one].map(([key, bytes]) => [key, Math.min(bytes, other.get(key) ?? 0)]));
  return { by, sum: [...by.values()].reduce((a, b) => a + b, 0) };
}

async function least(page, cdp) {
  // Whoever is counted at all is counted rightly: of what is not compiled yet there is much.
  const early = await allocated(page, cdp, () => pass(page, 20));
  assert.ok(early.sum.drawing > 0, "three.js draws, and that is not seen");
  await hold(page, true);
  const found = {};
  let before = null;
  const enough = () => found.picture?.sum < FEW && found.drawing.sum < FEW;
  for (let stretch = 0; stretch < MOST && !enough(); stretch += 1) {
    const one = await allocated(page, cdp, () => pass(page, 100));
    for (const part of before ? ["picture", "drawing"] : []) {
      const both = inBoth(before.by[part], one.by[part]);
      if (!found[part] || both.sum < found[part].sum) found[part] = both;
    }
    before = one;
  }
  await hold(page, false);
  return found;
}

function assertFew({ picture, drawing }) {
  const told = ({ sum, by }) => `${sum.toFixed(0)} B per picture:\n${most(by).join("\n")}`;
  assert.ok(picture.sum < FEW, `of the page's own ${told(picture)}`);
  assert.ok(drawing.sum < FEW, `of three.js's drawing ${told(drawing)}`);
}

for (const draw of ["light", "full"]) {
  test(`a picture that is drawn ${draw} allocates nothing, on the desk and in a headset`, async () => {
    const browser = await openBrowser({ width: 640, height: 360, flags: [COMPILED] });
    try {
      const { page } = browser;
      page.setDefaultTimeout(900_000);
      await page.addInitScript(`${HEADSET}\n${WRAPPED}\n${UNDRAWN}`);
      const address = new URL(served.url);
      address.searchParams.set("draw", draw);
      await page.goto(address.href);
      await page.waitForFunction(() => window.seerob?.pose("operator/head") != null);
      const cdp = await browser.context.newCDPSession(page);
      assertFew(await least(page, cdp));
      await enterRoom(page, "enter VR");
      await page.getByRole("status").getByText("headset on").waitFor();
      await put(page, [0, 1.6, 0], [0.25, 1.1, -0.3]);
      await pictures(page, 5);
      assertFew(await least(page, cdp));
    } finally {
      await browser.close();
    }
  });
}
