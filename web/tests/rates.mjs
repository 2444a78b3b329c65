// Pictures a second of the page beside a live run of the UR10 assembly at 1366 × 768, and what each costs in
// processor time, by process: `node tests/rates.mjs [seconds] [page folder …]`; of several pages, one after the
// other in turns, so that a loaded machine is as hard on each. SOFTWARE_GL=swiftshader asks for that renderer,
// WORKSTATION=folder for another run.

import fs from "node:fs";
import path from "node:path";
import { createInterface } from "node:readline";
import { fileURLToPath } from "node:url";
import { openBrowser } from "./browser.mjs";
import { python } from "./python.mjs";

const ROOT = path.resolve(path.dirname(fileURLToPath(import.meta.url)), "../..");
const SECONDS = Number(process.argv[2] ?? 10);
const PAGES = process.argv.slice(3);
const TICKS_PER_S = 100;

/** Processor time of each process of the browser so far, by kind [s]. */
async function spent(session) {
  const { processInfo } = await session.send("SystemInfo.getProcessInfo");
  const by = {};
  for (const { type, id } of processInfo) {
    const fields = fs.readFileSync(`/proc/${id}/stat`, "utf8").split(") ")[1].split(" ");
    by[type] = (by[type] ?? 0) + (Number(fields[11]) + Number(fields[12])) / TICKS_PER_S;
  }
  return by;
}

const child = python(
  "-m",
  "seerob",
  "run",
  process.env.WORKSTATION ?? path.join(ROOT, "workstations/ur10_assembly"),
  "--port",
  "0",
  "--no-record",
);
let url;
for await (const line of createInterface({ input: child.stdout })) {
  url = line.match(/http:\/\/\S+/)?.[0];
  if (url) break;
}
child.stdout.resume();

async function measure(folder) {
  const browser = await openBrowser({ width: 1366, height: 768 });
  const { page } = browser;
  if (folder) {
    const { "content-length": _, ...headers } = Object.fromEntries((await fetch(url)).headers);
    await page.route("**/*", (route) => {
      const { pathname } = new URL(route.request().url());
      const file = `${folder}${pathname === "/" ? "/index.html" : pathname}`;
      if (!fs.existsSync(file)) return route.continue();
      const type = { html: "text/html", js: "text/javascript", css: "text/css", svg: "image/svg+xml" }[
        file.split(".").at(-1)
      ];
      return route.fulfill({ body: fs.readFileSync(file), headers: { ...headers, "content-type": type } });
    });
  }
  await page.addInitScript(() => {
    window.pictures = 0;
    const { clear } = WebGL2RenderingContext.prototype;
    let last = -1;
    window.frames = 0;
    const count = () => {
      window.frames += 1;
      requestAnimationFrame(count);
    };
    requestAnimationFrame(count);
    WebGL2RenderingContext.prototype.clear = function (mask) {
      if (window.frames !== last) window.pictures += 1;
      last = window.frames;
      return clear.call(this, mask);
    };
  });
  await page.goto(url);
  await page.waitForFunction(() => Number.isFinite(window.seerob?.t));
  await page.waitForTimeout(6000);
  const session = await browser.context.browser().newBrowserCDPSession();
  const before = await spent(session);
  const counts = () => page.evaluate(() => [window.pictures, window.frames, performance.now()]);
  const from = await counts();
  await page.waitForTimeout(1000 * SECONDS);
  const to = await counts();
  const after = await spent(session);
  const drawn = to[0] - from[0];
  const seconds = (to[2] - from[2]) / 1000;
  const cost = Object.entries(after).map(
    ([kind, s]) => `${kind} ${((1000 * (s - before[kind])) / (drawn || seconds)).toFixed(1)}`,
  );
  const per = drawn ? "picture" : "second";
  process.stdout.write(
    `${folder ?? "page"}: ${(drawn / seconds).toFixed(1)} pictures a second, ` +
      `${((to[1] - from[1]) / seconds).toFixed(1)} callbacks; ms of processor time per ${per}: ${cost.join(", ")}\n`,
  );
  await browser.close();
}

for (let turn = 0; turn < (PAGES.length > 1 ? 2 : 1); turn += 1)
  for (const folder of PAGES.length > 0 ? PAGES : [null]) await measure(folder);
child.kill("SIGINT");
