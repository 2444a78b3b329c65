// What a picture costs the page, on the desk and in an emulated headset, with 50 bodies at 100 Hz:
// `node tests/page_cost.mjs [seconds] [--where]`.
// Told are the script's time per picture (processor time of the page's thread, from the browser's trace), what is
// allocated per picture, and how old the poses are, by the clock that both ends share: when the server offers them to
// pages, when they are taken for a picture, and when the script is done with it; and how many
// snapshots were sent and how many replaced before they were. `--where` tells which functions allocate, and whose the
// script's time is; a build with `npx vite build --minify false --sourcemap` names them.

import { SourceMap } from "node:module";
import { openBrowser } from "./browser.mjs";
import { enterRoom, HEADSET, pictures, put } from "./emulated_headset.mjs";
import { serve } from "./served.mjs";

const SECONDS = Number(process.argv[2] ?? 10);
/** Until V8 has compiled what each picture does [s]. */
const WARM = 25;
const WHERE = process.argv.includes("--where");
const BODIES = 50;
/** Of the cell itself. */
const OWN = 22;
// Told in arrays that are made once: measuring allocates nothing.
const WRAPPED = `
(() => {
  const most = 1 << 16;
  const cost = { n: 0, begun: 0, taken: new Float64Array(most), done: new Float64Array(most), said: new Float64Array(most) };
  window.cost = cost;
  const wrapped = (own) => {
    const kept = new WeakMap();
    return function (act) {
      let timed = kept.get(act);
      if (!timed) {
        timed = function timed(time, frame) {
          const begun = performance.now();
          act(time, frame);
          const now = performance.now();
          const { seerob } = window;
          if (!seerob || !(seerob.posed >= 0) || cost.n >= most || seerob.posed === cost.last) return;
          cost.last = seerob.posed;
          const zero = cost.begun - performance.timeOrigin;
          cost.taken[cost.n] = begun - zero - 1000 * seerob.posed;
          cost.done[cost.n] = now - zero - 1000 * seerob.posed;
          cost.said[cost.n] = now - zero - 1000 * seerob.t;
          cost.n += 1;
        };
        kept.set(act, timed);
      }
      return own.call(this, timed);
    };
  };
  window.requestAnimationFrame = wrapped(window.requestAnimationFrame);
  const session = window.XRSession?.prototype;
  if (session?.requestAnimationFrame) session.requestAnimationFrame = wrapped(session.requestAnimationFrame);
})();`;

const served = await serve("--mode", "live", "--seconds", "3600", "--further", String(BODIES - OWN));
const browser = await openBrowser({ width: 640, height: 360, flags: ["--enable-precise-memory-info"] });
const { page } = browser;
await page.addInitScript(`${HEADSET}\n${WRAPPED}\nwindow.cost.begun = ${1000 * served.begun};`);
await page.goto(served.url);
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

/** Functions that ask WebXR for poses: what it tells is made anew by the browser, each number of a point an object. */
const POSES = ["hold"];
/** What this measurement asks the page. */
const ASKED = ["get t", "get posed"];

/** Functions that write figures, in the page or in the room: four times a second, not once per picture. */
const FIGURES = ["publish", "paint"];

/**
 * Bytes by function, of what is done for a picture, of poses that WebXR tells for it, of three.js's own drawing in it, of figures that are written in it,
 * of what comes by message, and of the rest: panels and plots, at their own pace. What the browser makes of a call is
 * the caller's, of an emulator's or this measurement's nobody's.
 */
function allocated(head) {
  const into = {
    picture: new Map(),
    poses: new Map(),
    drawing: new Map(),
    figures: new Map(),
    heard: new Map(),
    panels: new Map(),
    theirs: new Map(),
  };
  const walk = ({ callFrame: { url, functionName, lineNumber }, selfSize, children }, part, ours) => {
    let within = functionName === "timed" ? "picture" : functionName.endsWith("onmessage") ? "heard" : part;
    if (within === "picture" && functionName.endsWith(".render")) within = "drawing";
    if (within === "picture" && FIGURES.includes(functionName)) within = "figures";
    // Functions of the browser's own have no line.
    const own = url.includes("/assets/") || (url === "" && lineNumber < 0 && (ours || within === "heard"));
    const asked = within === "picture" && ASKED.includes(functionName);
    const told = within === "picture" && POSES.includes(functionName) ? "poses" : within;
    const to = into[own && !asked ? told : "theirs"];
    const key = `${functionName || "(anonymous)"}:${lineNumber}${url === "" && ours ? ` of ${ours}` : ""}`;
    to.set(key, (to.get(key) ?? 0) + selfSize);
    const mine = url.includes("/assets/") ? functionName || "(anonymous)" : url === "" ? ours : "";
    for (const child of children) walk(child, within, mine);
  };
  walk(head, "panels", "");
  return into;
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
  await page.waitForTimeout(1000 * WARM);
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
  await cdp.send("HeapProfiler.startSampling", {
    samplingInterval: 256,
    includeObjectsCollectedByMajorGC: true,
    includeObjectsCollectedByMinorGC: true,
  });
  const count = () => page.evaluate(() => window.cost.n);
  const from = await count();
  await page.waitForTimeout(1000 * SECONDS);
  const drawn = (await count()) - from;
  const { profile } = await cdp.send("HeapProfiler.stopSampling");
  const parts = allocated(profile.head);
  const kilobytes = (part) =>
    `${([...parts[part].values()].reduce((a, b) => a + b, 0) / drawn / 1000).toFixed(1)} kB`;
  const mean = slots.reduce((a, b) => a + b, 0) / slots.length;
  process.stdout.write(
    `${name}: ${BODIES} bodies at 100 Hz, ${taken.length} pictures in ${SECONDS} s\n` +
      `  script per picture  mean ${mean.toFixed(2)}, ${both(slots)} of processor time (${collected} collections in ${slots.length} pictures)\n` +
      `  ${sent} snapshots sent, ${skipped} replaced before they were\n` +
      `  age when offered ${both(ages.slice(-100 * SECONDS).map((s) => 1000 * s))}; of poses when taken ${both(taken)}; when the picture's script is done ${both(done)}; of markers and figures then ${both(said)}\n` +
      `  allocated per picture ${kilobytes("picture")} for it, ${kilobytes("poses")} by poses that WebXR tells, ${kilobytes("drawing")} by three.js's own drawing, ${kilobytes("figures")} by figures written then, ${kilobytes("heard")} by what is heard, ${kilobytes("panels")} by panels; ${kilobytes("theirs")} by emulator and measurement\n`,
  );
  if (!WHERE) return;
  process.stdout.write("  whose the time is, ms per picture by the clock\n");
  for (const [whose, ms] of (await spent(count)).slice(0, 24))
    process.stdout.write(`    ${ms.toFixed(3).padStart(8)} ${whose}\n`);
  for (const part of ["picture", "poses", "drawing", "figures", "heard", "panels"]) {
    process.stdout.write(`  ${part}\n`);
    const most = [...parts[part]].sort((a, b) => b[1] - a[1]).slice(0, 30);
    for (const [key, bytes] of most)
      process.stdout.write(`    ${(bytes / drawn).toFixed(0).padStart(8)} ${key}\n`);
  }
}

await measure("desk");
await enterRoom(page, "enter VR");
await page.getByRole("status").getByText("headset on").waitFor();
await put(page, [0, 1.6, 0], [0.25, 1.1, -0.3]);
await pictures(page, 5);
await measure("emulated VR");
await browser.close();
await served.close();
