// Pictures of each view at the sizes that the page is made for, dark and light: `node tests/views.mjs` writes
// docs/pictures/views anew, and docs/views.md, which shows them; `node tests/views.mjs across` that size only.

import { execFileSync } from "node:child_process";
import fs from "node:fs";
import os from "node:os";
import path from "node:path";
import { fileURLToPath } from "node:url";
import { openBrowser } from "./browser.mjs";
import { edited, showEdited } from "./edited.mjs";
import { python } from "./python.mjs";
import { replayed } from "./replayed.mjs";

const ROOT = path.resolve(path.dirname(fileURLToPath(import.meta.url)), "../..");
const TO = path.join(ROOT, "docs/pictures/views");
const SIZES = { "1920x1080": [1920, 1080], "1366x768": [1366, 768], upright: [390, 844], across: [844, 390] };
const LOOKS = ["dark", "light"];
/** The room is sharp once it is still [ms]. */
const SHARP_MS = 1500;

const folder = fs.mkdtempSync(path.join(os.tmpdir(), "seerob-views-"));
const cell = path.join(folder, "guarded_cell");
fs.cpSync(path.join(ROOT, "workstations/guarded_cell"), cell, { recursive: true });
const only = process.argv.slice(2);
if (only.length === 0) fs.rmSync(TO, { recursive: true, force: true });
fs.mkdirSync(TO, { recursive: true });

async function guarded() {
  const out = path.join(folder, "run");
  await new Promise((resolve) => python("-m", "seerob", "assess", cell, "-o", out).once("exit", resolve));
  const file = fs.readdirSync(out).find((name) => name.endsWith(".mcap"));
  return replayed(path.join(out, file));
}

const VIEWS = {
  replay: { title: "A run that is replayed", of: guarded, ready: paused },
  view: {
    title: "A section, and what is taken along",
    of: null,
    ready: async (page) => {
      await page.getByRole("button", { name: "View", exact: true }).click();
      await page.locator(".view-panel").getByLabel("Section").selectOption("x");
      await page.locator(".view-panel").getByRole("slider").fill("0.6");
    },
  },
  edit: {
    title: "A workstation that is edited",
    of: () => edited(cell),
    ready: async (page) => {
      await page.getByLabel("What is edited").selectOption({ label: "rack" });
    },
  },
};

async function paused(page) {
  await page.waitForFunction(() => Number.isFinite(window.seerob?.t));
  await page.locator(".pill-now").waitFor();
  await page.keyboard.press("w");
  await page.keyboard.press("Escape");
}

const browser = await openBrowser({ width: 1366, height: 768 });
const { page } = browser;
page.setDefaultTimeout(60_000);
let served = null;
for (const [view, { of, ready }] of Object.entries(VIEWS)) {
  if (of) {
    await served?.close();
    served = await of();
    await page.setViewportSize({ width: 1366, height: 768 });
    if (view === "edit") await showEdited(page, served.url);
    else await page.goto(served.url);
  }
  await ready(page);
  for (const [size, [width, height]] of Object.entries(SIZES)) {
    if (only.length > 0 && !only.includes(size)) continue;
    await page.setViewportSize({ width, height });
    for (const colorScheme of LOOKS) {
      await page.emulateMedia({ colorScheme });
      await page.waitForFunction((theme) => document.documentElement.dataset.theme === theme, colorScheme);
      await page.waitForTimeout(SHARP_MS);
      const picture = await page.screenshot();
      fs.writeFileSync(path.join(TO, `${view}-${size}-${colorScheme}.webp`), await small(picture));
    }
  }
}
await Promise.all([browser.close(), served?.close()]);
fs.rmSync(folder, { recursive: true });

let text =
  "# Views\n\nMade by `node web/tests/views.mjs` in headless Chromium, of `workstations/guarded_cell`.\n";
for (const [view, { title }] of Object.entries(VIEWS)) {
  text += `\n## ${title}\n`;
  for (const size of Object.keys(SIZES)) {
    const cells = LOOKS.map(
      (look) => `![${title}, ${size}, ${look}](pictures/views/${view}-${size}-${look}.webp)`,
    );
    text += `\n${cells.join("\n")}\n`;
  }
}
fs.writeFileSync(path.join(ROOT, "docs/views.md"), text);
process.stdout.write(execFileSync("du", ["-sh", TO]));

/** A picture as WebP, by the browser that took it. */
async function small(png) {
  const tool = await browser.context.newPage();
  const data = await tool.evaluate(async (text) => {
    const picture = await createImageBitmap(await (await fetch(`data:image/png;base64,${text}`)).blob());
    const canvas = document.createElement("canvas");
    [canvas.width, canvas.height] = [picture.width, picture.height];
    canvas.getContext("2d").drawImage(picture, 0, 0);
    return canvas.toDataURL("image/webp", 0.72).split(",")[1];
  }, png.toString("base64"));
  await tool.close();
  return Buffer.from(data, "base64");
}
