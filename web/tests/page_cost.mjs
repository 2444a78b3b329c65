// What a picture costs the page, on the desk and in an emulated headset, with 50 bodies at 100 Hz:
// `node tests/page_cost.mjs [seconds] [--where] [--card]`.
// Told are the script's time per picture (processor time of the page's thread, from the browser's trace), what is
// allocated per picture by the page, by three.js and by WebXR (garbage.mjs; by the page there is to be nothing), and how
// old the poses are, by the clock that both ends share: when the server offers them to pages, when they are taken for a
// picture, and when the script is done with it; and how many snapshots were sent and how many replaced before they were.
// `--card` draws as with a graphics card, with light and shadows; `--where` tells which functions allocate, and whose the script's time is; a build with
// `npx vite build --minify false --sourcemap` names them.

import { SourceMap } from "node:module";
import { openBrowser } from "./browser.mjs";
import { enterRoom, HEADSET, pictures, put } from "./emulated_headset.mjs";
import { allocated, COMPILED, drawn, hold, most, pass, WARM, WRAPPED } from "./garbage.mjs";
import { serve } from "./served.mjs";

const SECONDS = Number(process.argv[2] ?? 10);
const WHERE = process.argv.includes("--where");
const BODIES = 50;
/** Of the cell itself. */
const OWN = 22;

const served = await serve("--mode", "live", "--seconds", "3600", "--further", String(BODIES - OWN));
const browser = await openBrowser({
  width: 640,
  height: 360,
  flags: ["--enable-precise-memory-info", COMPILED],
});
const { page } = browser;
await page.addInitScript(`${HEADSET}\n${WRAPPED}\nwindow.cost.begun = ${1000 * served.begun};`);
const address = new URL(served.url);
if (process.argv.includes("--card")) address.searchParams.set("draw", "full");
await page.goto(address.href);
await page.waitForFunction(() => window.seerob?.pose("operator/head") != null);
const cdp = await browser.context.newCDPSession(page);

const quantile = (values, share) => values.toSorted((a, b) => a - b)[Math.floor(share * (values.length - 1))];
const both = (values) =>
  `p50 ${quantile(values, 0.5).toFixed(2)}, p95 ${quantile(values, 0.95).toFixed(2)} ms`;

/** Processor time of the script in each picture [ms], and of what comes by message between two. */
async function traced() {
  const events = [];
  const take = ({ value }) => events.push(...value);
  cdp.on("Tracing.dataCollected", take);
  await cdp.send("Tracing.start", {
    transferMode: "ReportEvents",
    traceConfig: { includedCategories: ["devtools.timeline", "v8", "disabled-by-default-v8.gc"] },
  });
  await page.waitForTimeout(1000 * SECONDS);
  const over = new Promise((done) => cdp.once("Tracing.tracingComplete", done));
  await cdp.send("Tracing.end");
  await over;
  cdp.off("Tracing.dataCollected", take);
  const fired = events.filter(({ name, tdur }) => name === "FireAnimationFrame" && tdur !== undefined);
  const thread = fired[0]?.tid;
  const messages = events.filter(
    ({ name, tid, tdur }) => name === "HandlePostMessage" && tid === thread && tdur !== undefined,
  );
  const collected = events.filter(
    ({ name, tid, dur }) => /^(MinorGC|MajorGC)$/.test(name) && tid === thread && dur,
  );
  // More than one callback may belong to a picture: the session's, the page's, and what waits for the next one.
  const slots = [];
  let open = null;
  for (const event of [...fired, ...messages].sort((a, b) => a.ts - b.ts)) {
    if (event.name === "FireAnimationFrame") {
      if (open === null || event.ts - open.end > 500) {
        open = { ms: 0, end: 0 };
        slots.push(open);
      }
      open.end = event.ts + event.dur;
    }
    if (open) open.ms += event.tdur / 1000;
  }
  return { slots: slots.map(({ ms }) => ms), collected: collected.length };
}

const maps = new Map();

/** Whose a function is: of three.js, of another package, a file of the page, or of the emulator and of this. */
async function ownerOf({ url, lineNumber, columnNumber }) {
  if (!url.includes("/assets/")) return "emulator and measurement";
  if (!maps.has(url)) {
    const answer = await fetch(`${url}.map`);
    maps.set(url, answer.ok ? new SourceMap(await answer.json()) : null);
  }
  const from = maps.get(url)?.findEntry(lineNumber, columnNumber).originalSource ?? "";
  return from.match(/node_modules\/((?:@[^/]+\/)?[^/]+)/)?.[1] ?? from.match(/src\/.*/)?.[0] ?? "the page";
}

/** Time that is spent in functions themselves, by whose they are [ms per picture]. */
async function spent(pictures) {
  await cdp.send("Profiler.enable");
  await cdp.send("Profiler.setSamplingInterval", { interval: 200 });
  const from = await pictures();
  await cdp.send("Profiler.start");
  await page.waitForTimeout(1000 * SECONDS);
  const { profile } = await cdp.send("Profiler.stop");
  const drawn = (await pictures()) - from;
  const nodes = new Map(profile.nodes.map((node) => [node.id, node]));
  const by = new Map();
  const parents = new Map(
    profile.nodes.flatMap(({ id, children = [] }) => children.map((child) => [child, id])),
  );
  for (const [k, id] of profile.samples.entries()) {
    const { callFrame } = nodes.get(id);
    // What the browser does is told with who asked for it.
    const asker = callFrame.url === "" ? nodes.get(parents.get(id))?.callFrame : undefined;
    const asked = asker?.url ? `, asked by ${await ownerOf(asker)}` : "";
    const whose = callFrame.url ? await ownerOf(callFrame) : `${callFrame.functionName}${asked}`;
    by.set(whose, (by.get(whose) ?? 0) + profile.timeDeltas[k] / 1000 / drawn);
  }
  return [...by].sort((a, b) => b[1] - a[1]);
}

async function measure(name) {
  await pass(page, 2 * WARM);
  const { slots, collected } = await traced();
  await page.evaluate(() => {
    window.cost.n = 0;
  });
  const before = (await served.tell("told")).clients[0];
  await page.waitForTimeout(1000 * SECONDS);
  const { ages, clients } = await served.tell("told");
  const [sent, skipped] = clients[0].map((count, i) => count - before[i]);
  const { taken, done, said } = await page.evaluate(() => {
    const of = (key) => [...window.cost[key].subarray(0, window.cost.n)];
    return { taken: of("taken"), done: of("done"), said: of("said") };
  });
  const during = () => page.waitForTimeout(1000 * SECONDS);
  const all = await allocated(page, cdp, during);
  await hold(page, true);
  const alone = await allocated(page, cdp, during);
  await hold(page, false);
  const kilobytes = (bytes) => `${(bytes / 1000).toFixed(2)} kB`;
  const mean = slots.reduce((a, b) => a + b, 0) / slots.length;
  process.stdout.write(
    `${name}: ${BODIES} bodies at 100 Hz, ${taken.length} pictures in ${SECONDS} s\n` +
      `  script per picture  mean ${mean.toFixed(2)}, ${both(slots)} of processor time (${collected} collections in ${slots.length} pictures)\n` +
      `  ${sent} snapshots sent, ${skipped} replaced before they were\n` +
      `  age when offered ${both(ages.slice(-100 * SECONDS).map((s) => 1000 * s))}; of poses when taken ${both(taken)}; when the picture's script is done ${both(done)}; of markers and figures then ${both(said)}\n` +
      `  allocated per picture, by itself (${alone.pictures} pictures): ${kilobytes(alone.sum.picture)} by the page, of which there is to be none; ${kilobytes(alone.sum.drawing)} by three.js's own drawing; ${kilobytes(alone.sum.poses)} by poses that WebXR tells\n` +
      `  spread over pictures, what is done a few times a second: ${kilobytes(Math.max(all.sum.picture - alone.sum.picture, 0) + all.sum.figures)} by figures written then, ${kilobytes(all.sum.heard)} by what is heard, ${kilobytes(all.sum.panels)} by panels; ${kilobytes(all.sum.theirs)} by emulator and measurement\n`,
  );
  if (!WHERE) return;
  process.stdout.write("  whose the time is, ms per picture by the clock\n");
  for (const [whose, ms] of (await spent(() => drawn(page))).slice(0, 24))
    process.stdout.write(`    ${ms.toFixed(3).padStart(8)} ${whose}\n`);
  for (const part of ["picture", "poses", "drawing"])
    process.stdout.write(`  ${part}, by itself [B]\n${most(alone.by[part], 30).join("\n")}\n`);
  for (const part of ["picture", "figures", "heard", "panels"])
    process.stdout.write(`  ${part}, with what is told [B]\n${most(all.by[part], 30).join("\n")}\n`);
}

await measure("desk");
await enterRoom(page, "enter VR");
await page.getByRole("status").getByText("headset on").waitFor();
await put(page, [0, 1.6, 0], [0.25, 1.1, -0.3]);
await pictures(page, 5);
await measure("emulated VR");
await browser.close();
await served.close();
