// A headset without a headset: iwer, in the page before its own code; and what a visitor does with it.

import fs from "node:fs";

const RUNTIME = fs.readFileSync(new URL("../node_modules/iwer/build/iwer.min.js", import.meta.url), "utf8");

/** What runs in the page before its own code: a Quest 3, also where the browser has WebXR of its own. */
export const HEADSET = `${RUNTIME}
;(() => {
  const device = new IWER.XRDevice(IWER.metaQuest3);
  device.installRuntime({ forceInstall: true });
  window.headset = device;
  // The emulator draws a session into the page's own canvas, which is opaque where the processor draws: what is
  // behind glasses would be black. A headset has a canvas of its own.
  const { getContext } = HTMLCanvasElement.prototype;
  HTMLCanvasElement.prototype.getContext = function (kind, look) {
    return getContext.call(this, kind, kind === "webgl2" ? { ...look, alpha: true } : look);
  };
  // Who stands still moves by a fraction of a millimetre; what is the same to the last bit is frozen.
  const shaken = [device, device.controllers.left, device.controllers.right];
  const still = shaken.map((each) => [...each.position.vec3]);
  const noise = () => 4e-4 * (Math.random() - 0.5);
  window.put = (i, at) => {
    still[i] = at;
    shaken[i].position.set(...at);
  };
  setInterval(() => shaken.forEach((each, i) => each.position.set(...still[i].map((v) => v + noise()))), 10);
})();`;

/** Begin a session by what the page's one button offers; and wait until it is offered again. */
export async function enterRoom(page, name) {
  await page.locator(".room-offer summary").click({ timeout: 240_000 });
  await page.getByRole("button", { name, exact: true }).click({ timeout: 240_000 });
}
export const outOfRoom = (page) => page.locator(".room-offer").waitFor({ timeout: 240_000 });

/** Wait for so many pictures of the session. */
export function pictures(page, count) {
  return page.evaluate(
    (n) =>
      new Promise((done) => {
        const each = () => {
          n -= 1;
          if (n < 0) done();
          else window.headset.activeSession.requestAnimationFrame(each);
        };
        each();
      }),
    count,
  );
}

/** Put the head, and the right controller with where it points, in the room (y up) [m]. */
export function put(page, head, hand = null, direction = [0, 0, -1]) {
  return page.evaluate(
    ([h, c, d]) => {
      const { headset } = window;
      window.put(0, h);
      if (!c) return;
      const { right } = headset.controllers;
      window.put(2, c);
      // From -z to d: half way between both.
      const [x, y, z] = d;
      const far = Math.hypot(x, y, z);
      const w = 1 - z / far;
      const q = [y / far, -x / far, 0, w];
      const long = Math.hypot(...q);
      right.quaternion.set(...q.map((v) => v / long));
    },
    [head, hand, direction],
  );
}

/**
 * Lead the right controller to a point of the room as a hand goes, 1 cm from picture to picture [m]. Put there it would
 * be metres per second fast, and where the next picture is late the person goes on at that speed.
 */
export function lead(page, to) {
  return page.evaluate(
    (goal) =>
      new Promise((done) => {
        const at = window.headset.controllers.right.position.vec3.slice();
        const each = () => {
          const left = Math.hypot(...goal.map((v, i) => v - at[i]));
          const part = Math.min(1, 0.01 / left);
          for (let i = 0; i < 3; i++) at[i] += part * (goal[i] - at[i]);
          window.put(2, part < 1 ? [...at] : goal);
          if (part < 1) window.headset.activeSession.requestAnimationFrame(each);
          else done();
        };
        each();
      }),
    to,
  );
}

/** Press or let go of the right controller's trigger, and wait until a picture of the session knows it. */
export async function trigger(page, value) {
  await page.evaluate((v) => window.headset.controllers.right.updateButtonValue("trigger", v), value);
  // Whoever leaves sees no more pictures.
  if (await page.evaluate(() => window.headset.activeSession !== undefined)) await pictures(page, 2);
}

/** Press a button of the menu at the left wrist with the right hand's beam, the head being at a point of the room. */
export async function pressInRoom(page, label, head = [0, 1.6, 0]) {
  const there = await page.evaluate((name) => {
    const at = window.seerob.button(name);
    return at && window.seerob.inRoom(at);
  }, label);
  if (!there) throw new Error(`there is no button ${label}`);
  const from = [0.25, head[1] + 0.1, head[2]];
  await put(
    page,
    head,
    from,
    there.map((v, i) => v - from[i]),
  );
  await pictures(page, 3);
  await trigger(page, 1);
  await trigger(page, 0);
}
