// Names, contrasts, landmarks and the order of focus, by axe-core in a real browser, in each state of the page.

import assert from "node:assert/strict";
import fs from "node:fs";
import { createRequire } from "node:module";
import os from "node:os";
import path from "node:path";
import { after, before, test } from "node:test";
import { fileURLToPath, pathToFileURL } from "node:url";
import { open, settled } from "./expect.mjs";
import { python } from "./python.mjs";

const AXE = fs.readFileSync(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");
const ROOT = path.resolve(path.dirname(fileURLToPath(import.meta.url)), "../..");
const SIZES = { desk: [1366, 768], upright: [390, 844], across: [844, 390] };
let opened;
let page;

before(async () => {
  opened = await open(["--mode", "replay", "--seconds", "12"], { width: 1366, height: 768 });
  page = opened.page;
  await page.keyboard.press("Shift+ArrowRight");
  await settled(page);
  await page.evaluate(AXE);
});

after(() => opened?.close());

/** What axe finds, one line each: how bad, which rule, where. */
async function faults(where = page) {
  const { violations } = await where.evaluate(() =>
    globalThis.axe.run(document, { resultTypes: ["violations"] }),
  );
  return violations.flatMap(({ id, impact, nodes }) =>
    nodes.map(
      ({ target, failureSummary }) => `${impact} ${id}: ${target} ${failureSummary.replace(/\s+/g, " ")}`,
    ),
  );
}

const tab = (name) => page.getByRole("tab", { name }).click();
const STATES = {
  "criteria, one opened": async () => {
    await tab("Criteria");
    await page.locator('tr[data-criterion="separation"] .twist').click();
  },
  "body, one area": async () => {
    await tab("Body");
    await page.locator('[data-spot="24 right"]').click();
  },
  posture: () => tab("Posture"),
  findings: () => tab(/Findings/),
  "a robot selected": () => page.locator(".item .name").first().click(),
  "overlays open": () => page.getByRole("button", { name: "Overlays" }).click(),
  "a visited instant": async () => {
    await page.keyboard.press("Escape");
    await page.locator(".jump").first().or(page.locator(".pill-elsewhere")).first().click();
    await settled(page);
  },
  "the keys": () => page.keyboard.press("?"),
};

for (const [name, go] of Object.entries(STATES)) {
  test(`${name}: no fault, at a desk and on a phone held either way, dark and light`, async () => {
    await page.setViewportSize({ width: SIZES.desk[0], height: SIZES.desk[1] });
    await go();
    const found = [];
    for (const colorScheme of ["dark", "light"]) {
      await page.emulateMedia({ colorScheme });
      await page.waitForFunction((theme) => document.documentElement.dataset.theme === theme, colorScheme);
      for (const [size, [width, height]] of Object.entries(SIZES)) {
        await page.setViewportSize({ width, height });
        found.push(...(await faults()).map((fault) => `${colorScheme}, ${size}: ${fault}`));
      }
    }
    assert.deepEqual(found, []);
  });
}

test("a report and a comparison: no fault, at a desk and on a phone", async () => {
  const folder = fs.mkdtempSync(path.join(os.tmpdir(), "seerob-report-"));
  const cell = path.join(ROOT, "workstations/ur10_assembly");
  const ran = async (...parameters) => {
    const child = python("-m", "seerob", ...parameters);
    child.stdout.resume();
    await new Promise((resolve) => child.once("exit", resolve));
  };
  await ran("assess", cell, "-o", path.join(folder, "run"));
  await ran("compare", path.join(folder, "run"), cell, "--html", path.join(folder, "compared.html"));
  const shown = await opened.browser.context.newPage();
  const found = [];
  for (const name of ["run/report.html", "compared.html"]) {
    await shown.goto(pathToFileURL(path.join(folder, name)).href);
    await shown.evaluate(AXE);
    for (const [width, height] of [SIZES.desk, SIZES.upright]) {
      await shown.setViewportSize({ width, height });
      found.push(...(await faults(shown)).map((fault) => `${name}, ${width}: ${fault}`));
    }
  }
  await shown.close();
  fs.rmSync(folder, { recursive: true });
  assert.deepEqual(found, []);
});

test("dark or light is the system's choice until one is made here, which is kept", async () => {
  await page.keyboard.press("Escape");
  await page.setViewportSize({ width: SIZES.desk[0], height: SIZES.desk[1] });
  await page.emulateMedia({ colorScheme: "dark" });
  await page.waitForFunction(() => document.documentElement.dataset.theme === "dark");
  const ground = () => page.evaluate(() => getComputedStyle(document.body).backgroundColor);
  const dark = await ground();
  await page.getByLabel("Look").selectOption("light");
  await page.waitForFunction((before) => getComputedStyle(document.body).backgroundColor !== before, dark);
  await page.reload();
  await page.waitForSelector("tr[data-criterion]");
  assert.notEqual(await ground(), dark);
  await page.getByLabel("Look").selectOption("system");
  await page.waitForFunction((before) => getComputedStyle(document.body).backgroundColor === before, dark);
});

test("Tab goes from the top bar to the scene, the room, the verdicts and the time, in that order", async () => {
  await page.keyboard.press("Escape");
  await page.setViewportSize({ width: SIZES.desk[0], height: SIZES.desk[1] });
  await page.evaluate(() => document.activeElement?.blur());
  const visited = [];
  for (let k = 0; k < 120 && visited.at(-1) !== "strip"; k += 1) {
    await page.keyboard.press("Tab");
    const at = await page.evaluate(() => {
      const focus = document.activeElement;
      if (focus.matches(".strip")) return "strip";
      return ["topbar", "left", "centre", "right", "bottom"].find((part) => focus.closest(`.${part}`)) ?? "";
    });
    if (at !== "" && at !== visited.at(-1)) visited.push(at);
  }
  assert.deepEqual(visited.slice(-5), ["left", "centre", "right", "bottom", "strip"]);
});

test("nothing complained, and nothing was asked of another origin", () => {
  assert.deepEqual(opened.browser.complaints, []);
  assert.deepEqual(opened.browser.outside, []);
});
