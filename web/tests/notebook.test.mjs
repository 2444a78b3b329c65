// The widget of a notebook in a real browser, loaded as anywidget loads it: from memory, with no server at all.

import assert from "node:assert/strict";
import fs from "node:fs";
import os from "node:os";
import path from "node:path";
import { after, before, test } from "node:test";
import { fileURLToPath } from "node:url";
import { openBrowser } from "./browser.mjs";
import { python } from "./python.mjs";

const CELL = `title = "A cell that moves"
[[robots]]
name = "arm"
model = "library:ur5e"
[[sources]]
kind = "csv"
robot = "arm"
file = "motion.csv"
mapping = { time_unit = "s", joint_unit = "rad" }
[[safety]]
kind = "velocity"
at = "arm"
limit = 0.5
`;
const JOINTS = ["shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3"];
const folder = fs.mkdtempSync(path.join(os.tmpdir(), "seerob-notebook-"));
let browser;
let page;

before(async () => {
  fs.writeFileSync(path.join(folder, "workstation.toml"), CELL);
  const head = ["t", ...JOINTS.map((name) => `${name}_joint`)].join(",");
  const rows = Array.from({ length: 51 }, (_, k) => `${k / 100},${k / 50},-1,1,0,0,0`);
  fs.writeFileSync(path.join(folder, "motion.csv"), `${[head, ...rows].join("\n")}\n`);
  const script = path.join(path.dirname(fileURLToPath(import.meta.url)), "notebook.py");
  const [handed, opened] = await Promise.all([
    output(script, folder),
    openBrowser({ width: 900, height: 500 }),
  ]);
  browser = opened;
  page = browser.page;
  page.setDefaultTimeout(60_000);
  await page.evaluate(async (given) => {
    const bytes = (text) => new DataView(Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer);
    const values = {
      ...given,
      scene: bytes(given.scene),
      frames: given.frames.map(bytes),
      meshes: Object.fromEntries(Object.entries(given.meshes).map(([name, mesh]) => [name, bytes(mesh)])),
    };
    const url = URL.createObjectURL(new Blob([given._esm], { type: "text/javascript" }));
    const { default: widget } = await import(url);
    globalThis.leave = widget.render({ model: { get: (name) => values[name] }, el: document.body });
  }, JSON.parse(handed));
});

after(async () => {
  await browser?.close();
  fs.rmSync(folder, { recursive: true });
});

async function output(...args) {
  const child = python(...args);
  let text = "";
  for await (const chunk of child.stdout) text += chunk;
  return text;
}

test("it shows the run, its verdict and that of the instant, and follows its slider", async () => {
  const slider = page.getByLabel("Time cursor");
  await page.locator(".seerob-run output", { hasText: /\d:\d\d/ }).waitFor();
  await slider.fill("0");
  assert.match(await page.locator(".bar").innerText(), /0:00\.00[\s\S]*the run: exceeded/);
  const first = await page.screenshot({
    path: process.env.PICTURES && `${process.env.PICTURES}/notebook.png`,
  });
  await slider.fill("10");
  assert.match(await page.locator(".bar").innerText(), /0:00\.40[\s\S]*✕ exceeded/);
  // A picture is asked for, and made on a processor.
  for (let again = 0; first.equals(await page.screenshot()); again += 1) {
    assert.ok(again < 100, "the picture stays");
    await page.waitForTimeout(200);
  }
});

test("it plays to its end, and asks nobody for anything", async () => {
  await page.getByLabel("Time cursor").fill("8");
  await page.getByRole("button", { name: /Play/ }).click();
  await page.locator(".seerob-run output", { hasText: "0:00.50" }).waitFor();
  assert.deepEqual(browser.outside, []);
  assert.deepEqual(browser.complaints, []);
  await page.evaluate(() => globalThis.leave());
  assert.equal(await page.locator(".seerob-run").count(), 0);
});
