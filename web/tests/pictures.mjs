// The picture of docs/editing.md: `node tests/pictures.mjs` writes it anew.

import fs from "node:fs";
import os from "node:os";
import path from "node:path";
import { fileURLToPath } from "node:url";
import { openBrowser } from "./browser.mjs";
import { edited, showEdited } from "./edited.mjs";

const ROOT = path.resolve(path.dirname(fileURLToPath(import.meta.url)), "../..");
const folder = fs.mkdtempSync(path.join(os.tmpdir(), "seerob-picture-"));
fs.cpSync(path.join(ROOT, "workstations/guarded_cell"), folder, { recursive: true });
const [{ url, close }, browser] = await Promise.all([
  edited(folder),
  openBrowser({ width: 1366, height: 768 }),
]);
const { page } = browser;
await page.emulateMedia({ colorScheme: "dark" });
await showEdited(page, url);
await page.getByLabel("What is edited").selectOption({ label: "rack" });
const x = page.getByLabel("x [m]");
await x.fill("2");
await x.press("Enter");
await page.locator(".edit-bar [role=status]", { hasText: "not saved" }).waitFor();
const name = page.locator('[data-field="name"] input');
await name.fill("the rack");
await name.press("Enter");
await page.locator(".mistake").first().waitFor();
await page.waitForTimeout(1000); // the room is sharp once it is still
await page.screenshot({ path: path.join(ROOT, "docs/pictures/editing.png") });
await Promise.all([browser.close(), close()]);
fs.rmSync(folder, { recursive: true });
