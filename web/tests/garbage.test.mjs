// A picture in the room allocates nothing of the page's own: bodies, markers and captions that move, on the desk and in an
// emulated headset.

import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { openBrowser } from "./browser.mjs";
import { enterRoom, HEADSET, pictures, put } from "./emulated_headset.mjs";
import { allocated, COMPILED, hold, most, pass, WARM, WRAPPED } from "./garbage.mjs";
import { serve } from "./served.mjs";

/** A number of each of fifty bodies would be more, and what the measurement takes for the page's is less [B]. */
const BOUND = 400;
const FURTHER = 28;
// What is drawn does not matter here, and takes the longest.
const UNDRAWN = `
for (const key of ["drawElements", "drawArrays", "drawElementsInstanced", "drawArraysInstanced", "clear", "blitFramebuffer"])
  WebGL2RenderingContext.prototype[key] = () => {};`;

let served;
let browser;
let page;
let cdp;

before(async () => {
  served = await serve("--mode", "live", "--seconds", "3600", "--further", String(FURTHER));
  browser = await openBrowser({ width: 640, height: 360, flags: [COMPILED] });
  page = browser.page;
  page.setDefaultTimeout(900_000);
  await page.addInitScript(`${HEADSET}\n${WRAPPED}\n${UNDRAWN}`);
  await page.goto(served.url);
  await page.waitForFunction(() => window.seerob?.pose("operator/head") != null);
  cdp = await browser.context.newCDPSession(page);
});

after(async () => {
  await browser?.close();
  await served?.close();
});

/** Stretches of 100 pictures until V8 has compiled the last function: what it had merged into another begins anew. */
const MOST = 40;

/** What every picture allocates is there in each stretch of them; what is compiled or written meanwhile is not. */
async function least() {
  await pass(page, WARM);
  await hold(page, true);
  let found = null;
  for (let stretch = 0; stretch < MOST && !(found?.sum.picture < BOUND); stretch += 1) {
    const one = await allocated(page, cdp, () => pass(page, 100));
    // Whoever is counted at all is counted rightly.
    assert.ok(one.sum.drawing > 0, "three.js draws, and that is not seen");
    if (!found || one.sum.picture < found.sum.picture) found = one;
  }
  await hold(page, false);
  return found;
}

function assertFew({ sum, by }) {
  assert.ok(
    sum.picture < BOUND,
    `${sum.picture.toFixed(0)} B of the page's own per picture:\n${most(by.picture).join("\n")}`,
  );
}

test("on the desk a picture allocates nothing of the page's own", async () => {
  assertFew(await least());
});

test("in a headset a picture allocates nothing of the page's own", async () => {
  await enterRoom(page, "enter VR");
  await page.getByRole("status").getByText("headset on").waitFor();
  await put(page, [0, 1.6, 0], [0.25, 1.1, -0.3]);
  await pictures(page, 5);
  assertFew(await least());
});
