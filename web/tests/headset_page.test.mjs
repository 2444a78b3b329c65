// A page with a headset that is made up: from the button to the real server and its answer.

import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { open } from "./expect.mjs";

let opened;
let browser;
let page;

/** Runs in the page, before its own code: a headset that does 20 pictures a second and has one controller. */
function madeUpHeadset() {
  const at = (x, y, z) => ({
    emulatedPosition: false,
    transform: { position: { x, y, z }, orientation: { x: 0, y: 0, z: 0, w: 1 } },
  });
  const frame = { getViewerPose: () => at(0, 1.7, 0), getPose: () => at(0.3, 1, -0.4) };
  class Session extends EventTarget {
    inputSources = [{ handedness: "right", gripSpace: {}, hand: undefined }];
    requestReferenceSpace = async () => ({});
    requestAnimationFrame = (callback) => setTimeout(() => callback(performance.now(), frame), 50);
    cancelAnimationFrame = (handle) => clearTimeout(handle);
  }
  const xr = {
    isSessionSupported: async (mode) => mode === "immersive-vr",
    requestSession: async () => {
      window.session = new Session();
      return window.session;
    },
  };
  Object.defineProperty(navigator, "xr", { value: xr });
}

before(async () => {
  opened = await open(["--mode", "live"], { width: 1280, before: madeUpHeadset });
  ({ browser, page } = opened);
});

after(() => opened?.close());

test("whoever wears it offers to be the person, and hears when nothing waits for it", async () => {
  await page.getByRole("button", { name: "be operator", exact: true }).click({ timeout: 120_000 });
  const answer = page.getByText("nothing in this run waits for a headset of 'operator'");
  await answer.waitFor({ timeout: 120_000 });
  assert.equal(await page.getByRole("button", { name: "headset on" }).isDisabled(), true);
  assert.deepEqual(browser.complaints, []);
});

test("when the session ends it can be begun again", async () => {
  await page.evaluate(() => window.session.dispatchEvent(new Event("end")));
  const again = page.getByRole("button", { name: "be operator", exact: true });
  await again.waitFor({ timeout: 120_000 });
  assert.equal(await again.isEnabled(), true);
});
