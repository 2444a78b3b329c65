// The pictures of README.md and docs/editing.md: `node tests/pictures.mjs` writes them anew.

import fs from "node:fs";
import os from "node:os";
import path from "node:path";
import { fileURLToPath } from "node:url";
import { openBrowser } from "./browser.mjs";
import { edited, showEdited } from "./edited.mjs";
import { settled, show } from "./expect.mjs";
import { python } from "./python.mjs";
import { replayed } from "./replayed.mjs";

const ROOT = path.resolve(path.dirname(fileURLToPath(import.meta.url)), "../..");
const folder = fs.mkdtempSync(path.join(os.tmpdir(), "seerob-picture-"));

/** Keep what a page shows, once its room is sharp. */
async function keep(page, name) {
  await page.waitForTimeout(1000);
  await page.screenshot({ path: path.join(ROOT, "docs/pictures", `${name}.png`) });
}

/** The demo at its worst instant. */
async function replayedDemo() {
  const out = path.join(folder, "run");
  const child = python("-m", "seerob", "assess", path.join(ROOT, "workstations/ur10_assembly"), "-o", out);
  child.stdout.resume();
  await new Promise((resolve) => child.once("exit", resolve));
  const [run, browser] = await Promise.all([
    replayed(path.join(out, "run.mcap")),
    openBrowser({ width: 1440, height: 900 }),
  ]);
  const { page } = browser;
  await page.emulateMedia({ colorScheme: "dark" });
  await show(page, run.url);
  await page.keyboard.press("w");
  await settled(page);
  await keep(page, "page");
  await Promise.all([browser.close(), run.close()]);
}

/** A part that was moved, and a name that is refused. */
async function editedCell() {
  const cell = path.join(folder, "cell");
  fs.cpSync(path.join(ROOT, "workstations/guarded_cell"), cell, { recursive: true });
  const [run, browser] = await Promise.all([edited(cell), openBrowser({ width: 1366, height: 768 })]);
  const { page } = browser;
  await page.emulateMedia({ colorScheme: "dark" });
  await showEdited(page, run.url);
  await page.getByLabel("What is edited").selectOption({ label: "rack" });
  const x = page.getByLabel("x [m]");
  await x.fill("2");
  await x.press("Enter");
  await page.locator(".edit-bar [role=status]", { hasText: "not saved" }).waitFor();
  const name = page.locator('[data-field="name"] input');
  await name.fill("the rack");
  await name.press("Enter");
  await page.locator(".mistake").first().waitFor();
  await keep(page, "editing");
  await Promise.all([browser.close(), run.close()]);
}

await replayedDemo();
await editedCell();
fs.rmSync(folder, { recursive: true });
