// What a picture costs the page, on the desk and in an emulated headset: `node tests/page_cost.mjs [seconds]`.
// Told are the script's time per picture (processor time of the page's thread, and the 95th percentile by the clock),
// what the page itself allocates per picture, and how old the state is when it is drawn, over the freshest one.
// The emulator's own work is part of the script's time in the headset; in what is allocated it is told apart.

import { openBrowser } from "./browser.mjs";
import { HEADSET, pictures, put } from "./emulated_headset.mjs";
import { serve } from "./served.mjs";

const SECONDS = Number(process.argv[2] ?? 10);
const WRAPPED = `
(() => {
  window.cost = { took: [], age: [] };
  const wrapped = (own) =>
    function (act) {
      return own.call(this, (...given) => {
        const begun = performance.now();
        try {
          act(...given);
        } finally {
          const now = performance.now();
          window.cost.took.push(now - begun);
          if (Number.isFinite(window.seerob?.t)) window.cost.age.push(now / 1000 - window.seerob.t);
        }
      });
    };
  window.requestAnimationFrame = wrapped(window.requestAnimationFrame);
  const session = window.XRSession?.prototype;
  if (session?.requestAnimationFrame) session.requestAnimationFrame = wrapped(session.requestAnimationFrame);
})();`;

const served = await serve("--mode", "live", "--seconds", "3600");
const browser = await openBrowser({ width: 640, height: 360, flags: ["--enable-precise-memory-info"] });
const { page } = browser;
await page.addInitScript(`${HEADSET}\n${WRAPPED}`);
await page.goto(served.url);
await page.waitForFunction(() => window.seerob?.pose("operator/head") != null);
const cdp = await browser.context.newCDPSession(page);
await cdp.send("Performance.enable", { timeDomain: "threadTicks" });

const script = async () => {
  const { metrics } = await cdp.send("Performance.getMetrics");
  return metrics.find(({ name }) => name === "ScriptDuration").value;
};

/** Bytes by where they were allocated. */
function allocated({ callFrame: { url, functionName }, selfSize, children }, into = new Map()) {
  const ours = url.includes("/assets/");
  const key = ours ? functionName || "(anonymous)" : "(emulator, browser and this measurement)";
  into.set(key, (into.get(key) ?? 0) + selfSize);
  for (const child of children) allocated(child, into);
  return into;
}

const quantile = (values, share) => values.toSorted((a, b) => a - b)[Math.floor(share * (values.length - 1))];

async function measure(name) {
  await page.waitForTimeout(2000);
  const before = await script();
  await page.evaluate(() => {
    window.cost.took.length = 0;
    window.cost.age.length = 0;
  });
  await page.waitForTimeout(1000 * SECONDS);
  const spent = (await script()) - before;
  const { took, age } = await page.evaluate(() => window.cost);
  const freshest = Math.min(...age);
  await cdp.send("HeapProfiler.startSampling", {
    samplingInterval: 512,
    includeObjectsCollectedByMajorGC: true,
    includeObjectsCollectedByMinorGC: true,
  });
  const count = () => page.evaluate(() => window.cost.took.length);
  const from = await count();
  await page.waitForTimeout(1000 * SECONDS);
  const drawn = (await count()) - from;
  const { profile } = await cdp.send("HeapProfiler.stopSampling");
  const by = [...allocated(profile.head)].map(([key, bytes]) => [key, bytes / drawn]);
  const ours = by.filter(([key]) => !key.startsWith("(emulator")).sort((a, b) => b[1] - a[1]);
  const total = ours.reduce((sum, [, bytes]) => sum + bytes, 0);
  const ms = (value) => `${value.toFixed(2)} ms`;
  process.stdout.write(
    `${name}: ${took.length} pictures in ${SECONDS} s\n` +
      `  script per picture   ${ms((1000 * spent) / took.length)} of processor time, all that the page does;` +
      ` by the clock p50 ${ms(quantile(took, 0.5))}, p95 ${ms(quantile(took, 0.95))}\n` +
      `  age over the freshest p50 ${ms(1000 * (quantile(age, 0.5) - freshest))},` +
      ` p95 ${ms(1000 * (quantile(age, 0.95) - freshest))}\n` +
      `  allocated per picture ${total.toFixed(0)} byte by the page's own functions:` +
      ` ${ours
        .slice(0, 6)
        .map(([key, bytes]) => `${key} ${bytes.toFixed(0)}`)
        .join(", ")}\n`,
  );
}

await measure("desk");
await page.getByRole("button", { name: "enter VR", exact: true }).click();
await page.getByRole("status").getByText("headset on").waitFor();
await put(page, [0, 1.6, 0], [0.25, 1.1, -0.3]);
await pictures(page, 5);
await measure("emulated VR");
await browser.close();
await served.close();
