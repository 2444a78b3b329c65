// A distance measured in the page of a real replay is the recorded criterion's, and follows the instant.

import assert from "node:assert/strict";
import fs from "node:fs";
import { createRequire } from "node:module";
import os from "node:os";
import path from "node:path";
import { after, before, test } from "node:test";
import { openBrowser } from "./browser.mjs";
import { python } from "./python.mjs";
import { replayed } from "./replayed.mjs";

const AXE = fs.readFileSync(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");
const CELL = `title = "Measured"

[[robots]]
name = "ur5e"
model = "library:ur5e"

[[parts]]
name = "wall"
shape = { box = [0.1, 2, 2] }
at = { position = [1.2, 0, 1] }

[[parts]]
name = "block"
shape = { box = [0.4, 0.4, 0.1] }
at = { position = [-0.8, -0.8, 0.5], rpy_deg = [30, 0, 0] }

[[sources]]
kind = "csv"
robot = "ur5e"
file = "motion.csv"

[[safety]]
kind = "minimum_distance"
name = "to the wall"
between = ["ur5e", "wall"]
limit = 0.1
`;
const folder = fs.mkdtempSync(path.join(os.tmpdir(), "seerob-measure-"));
let served;
let browser;
let page;

before(async () => {
  fs.writeFileSync(path.join(folder, "workstation.toml"), CELL);
  const rows = ["time [s],J1 [rad],J2 [rad],J3 [rad],J4 [rad],J5 [rad],J6 [rad]"];
  for (let k = 0; k <= 100; k += 1) {
    const q = [0.3 * Math.sin(k / 25), -1.2, 1.4, -0.2, 1.5, 0].map((x) => x.toFixed(9));
    rows.push([(k / 100).toFixed(2), ...q].join(","));
  }
  fs.writeFileSync(path.join(folder, "motion.csv"), rows.join("\n"));
  const out = path.join(folder, "run");
  await new Promise((done) => python("-m", "seerob", "assess", folder, "-o", out).once("exit", done));
  [served, browser] = await Promise.all([
    replayed(path.join(out, "run.mcap")),
    openBrowser({ width: 1366, height: 768 }),
  ]);
  page = browser.page;
  page.setDefaultTimeout(60_000);
  await page.goto(served.url);
  await page.locator('tr[data-criterion="to the wall"]').waitFor();
});

after(async () => {
  await Promise.all([browser?.close(), served?.close()]);
  fs.rmSync(folder, { recursive: true, force: true });
});

const told = async () =>
  Number((await page.locator('tr[data-criterion="to the wall"] .value').innerText()).match(/[\d.]+/)[0]);

/** The measured distance of the instant that is shown. */
async function measured() {
  const t = await page.evaluate(() => window.seerob.t);
  await page.locator(".measure-note", { hasText: `at ${t.toFixed(2)} s` }).waitFor();
  return Number.parseFloat(await page.locator(".measure-note strong").innerText());
}

test("what is measured is what was recorded, at each instant that is shown", async () => {
  await page.keyboard.press("Home");
  await page.getByRole("button", { name: "Measure" }).click();
  await page.locator(".tree").getByRole("button", { name: "ur5e", exact: true }).click();
  await page.locator(".measure-note", { hasText: "ur5e, and the second one" }).waitFor();
  await page.locator(".tree").getByRole("button", { name: "wall", exact: true }).click();
  const seen = [];
  for (const [key, from, to] of [
    ["Home", 0, 0],
    ["Shift+ArrowRight", 0.5, 1],
    ["Home", 0, 0],
  ]) {
    await page.keyboard.press(key);
    await page.waitForFunction(([a, b]) => window.seerob.t >= a && window.seerob.t <= b, [from, to]);
    const distance = await measured();
    assert.ok(Math.abs(distance - (await told())) <= 1e-4 + 1e-9, `${distance}, ${await told()} recorded`);
    seen.push(distance);
  }
  assert.ok(Math.abs(seen[0] - seen[1]) > 0.001, String(seen));
  assert.equal(seen[0], seen[2]);
  await page.keyboard.press("Escape");
  await page.locator(".measure-note").waitFor({ state: "detached" });
});

test("the reach of a robot that is selected is an outline with a tolerance; axe finds no fault in either note", async () => {
  await page.evaluate(AXE);
  const faults = async () => {
    // What is out of date, as while the machine is busy, is dim.
    await page.waitForFunction(() => !document.querySelector(".stale"));
    const { violations } = await page.evaluate(() =>
      globalThis.axe.run(document, { resultTypes: ["violations"] }),
    );
    return violations.map(({ id, nodes }) => `${id} ${nodes[0].target}: ${nodes[0].failureSummary}`);
  };
  await page.keyboard.press("d");
  for (const name of ["ur5e", "wall"])
    await page.locator(".tree").getByRole("button", { name, exact: true }).click();
  await measured();
  assert.deepEqual(await faults(), []);
  await page.keyboard.press("Escape");
  await page.getByRole("button", { name: "View", exact: true }).click();
  await page.locator(".view-panel").getByLabel("Reach of what is selected").check();
  await page.locator(".tree").getByRole("button", { name: "ur5e", exact: true }).click();
  await page.locator(".measure-note", { hasText: /reach of ur5e.*up to [0-9.]+.m outside/s }).waitFor();
  assert.deepEqual(await faults(), []);
  await page.locator(".view-panel").getByLabel("Reach of what is selected").uncheck();
  await page.locator(".measure-note").waitFor({ state: "detached" });
  await page.getByRole("button", { name: "View", exact: true }).click();
  await page.keyboard.press("Escape");
});

test("the angle of two faces that are clicked is that of the bodies", async () => {
  await page.keyboard.press("d");
  await page.getByRole("button", { name: "Top", exact: true }).click();
  for (const point of [
    [1.2, 0.5, 2],
    [-0.8, -0.8, 0.5],
  ]) {
    await page.mouse.click(...(await page.evaluate((p) => window.seerob.project(p), point)));
    await page.locator(".measure-note", { hasText: point[0] > 0 ? "wall, and" : "wall ↔ block" }).waitFor();
  }
  await page.locator(".measure-note", { hasText: /faces as drawn at 30(\.0+)?°/ }).waitFor();
  await page.keyboard.press("Escape");
});
