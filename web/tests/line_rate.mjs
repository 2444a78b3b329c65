// Pictures a second of a workstation that runs, and what each costs: `node tests/line_rate.mjs folder [seconds]`.
// Told are pictures, processor time of the page's script and of the whole browser, and draw calls per picture, in a
// window of 1366 × 768: while one looks from one place, and while one turns the room by the mouse.

import fs from "node:fs";
import { createInterface } from "node:readline";
import { openBrowser } from "./browser.mjs";
import { python } from "./python.mjs";

const [folder, seconds = "10"] = process.argv.slice(2);
const run = python("-m", "seerob", "run", folder, "--port", "0", "--no-record", "--allow-outside");
let url = "";
for await (const line of createInterface({ input: run.stdout })) {
  url = /http:\S+/.exec(line)?.[0] ?? "";
  if (url) break;
}
run.stdout.resume();
const { page, context, close } = await openBrowser({ width: 1366, height: 768 });
await page.addInitScript(`{
  window.drawn = 0;
  for (const name of ["drawElements", "drawArrays", "drawElementsInstanced", "drawArraysInstanced"]) {
    const own = WebGL2RenderingContext.prototype[name];
    WebGL2RenderingContext.prototype[name] = function (...given) {
      window.drawn += 1;
      return own.apply(this, given);
    };
  }
}`);
await page.goto(url, { timeout: 600_000 });
const begun = Date.now();
await page.waitForFunction(() => window.seerob?.pose("operator/head") != null, null, { timeout: 600_000 });
// A picture is drawn once all meshes are there.
await page.waitForFunction(() => window.drawn > 0, null, { timeout: 600_000 });
const shown = (Date.now() - begun) / 1000;
await page.waitForTimeout(5000);
const cdp = await context.newCDPSession(page);
await cdp.send("Performance.enable", { timeDomain: "threadTicks" });
const script = async () => {
  const { metrics } = await cdp.send("Performance.getMetrics");
  return metrics.find(({ name }) => name === "ScriptDuration").value;
};
/** Processor time of what this process started but for the run, as Linux tells it [s]. */
const browser = () => {
  const all = new Map();
  for (const pid of fs.readdirSync("/proc").filter((name) => /^\d+$/.test(name))) {
    try {
      const fields = fs.readFileSync(`/proc/${pid}/stat`, "utf8").split(") ")[1].split(" ");
      all.set(Number(pid), [Number(fields[1]), (Number(fields[11]) + Number(fields[12])) / 100]);
    } catch {} // It has ended meanwhile.
  }
  const ours = (pid) => pid !== run.pid && (pid === process.pid || (all.has(pid) && ours(all.get(pid)[0])));
  return [...all].reduce((sum, [pid, [, used]]) => sum + (pid !== process.pid && ours(pid) ? used : 0), 0);
};
/** Pictures for some seconds, with what each costs. */
const measured = async (doing) => {
  const before = await script();
  const usedBefore = browser();
  const { pictures, calls } = await page.evaluate(
    (most) =>
      new Promise((resolve) => {
        const begun = performance.now();
        let [pictures, calls, before] = [0, 0, window.drawn];
        const next = () => {
          // Between two of these nothing may have been drawn: where nothing moved, or pictures come slowly.
          if (window.drawn > before) {
            pictures += 1;
            calls += window.drawn - before;
            before = window.drawn;
          }
          if (performance.now() - begun > most) resolve({ pictures, calls });
          else requestAnimationFrame(next);
        };
        requestAnimationFrame(next);
      }),
    1000 * Number(seconds),
  );
  const used = (1000 * (browser() - usedBefore)) / pictures;
  const cost = (1000 * ((await script()) - before)) / pictures;
  const rate = (pictures / Number(seconds)).toFixed(1);
  process.stdout.write(
    `${doing}: ${rate} pictures a second, ${cost.toFixed(1)} ms of script, ` +
      `${used.toFixed(0)} ms of the processor and ${(calls / pictures).toFixed(0)} draw calls each\n`,
  );
};
process.stdout.write(`page: shown after ${shown.toFixed(1)} s\n`);
await measured("looking from one place");
if (process.env.PICTURE) await page.screenshot({ path: process.env.PICTURE });
const box = await page.locator("canvas").first().boundingBox();
const [x, y] = [box.x + box.width / 2, box.y + box.height / 2];
let turning = true;
const turn = (async () => {
  await page.mouse.move(x, y);
  await page.mouse.down();
  for (let k = 0; turning; k += 1) {
    await page.mouse.move(x + 60 * Math.sin(k / 10), y + 20 * Math.sin(k / 7));
    await page.waitForTimeout(16);
  }
  await page.mouse.up();
})();
await measured("turning the room");
turning = false;
await turn;
await close();
run.kill("SIGINT");
