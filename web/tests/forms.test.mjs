// The forms of the editor in a real page of the real `seerob edit`: nothing is in the file that nobody entered, and
// what is not taken stays where it was typed, with the reason beside it.

import assert from "node:assert/strict";
import fs from "node:fs";
import os from "node:os";
import path from "node:path";
import { after, before, test } from "node:test";
import { openBrowser } from "./browser.mjs";
import { edited, showEdited } from "./edited.mjs";

const CELL = `title = "Forms"

[[robots]]
name = "robot"
model = "library:ur5e"

[[parts]]
name = "table"
shape = { box = [0.8, 1.4, 0.74] }
mass = 40
at = { position = [0.8, 0, 0.37] }

[[humans]]
name = "operator"
stature = 1.75
mass = 75
sex = "male"
at = { position = [3, 0, 0] }

[[sensors]]
name = "scanner"

[sensors.laser_scanner]
range = 4
angle_deg = 190
resolution_deg = 0.5

[[sensors.laser_scanner.fields]]
name = "protective"
corners = [[0, -1], [2, -1], [2, 1], [0, 1]]

[[safety]]
kind = "minimum_distance"
name = "beside the table"
between = ["table", "operator"]
limit = 0.5

[[safety]]
kind = "power_and_force"
name = "contacts"
robot = "robot"

[[safety]]
kind = "force_polytope"
name = "forces"
at = "robot/tool0"
`;
const folder = fs.mkdtempSync(path.join(os.tmpdir(), "seerob-forms-"));
fs.writeFileSync(path.join(folder, "workstation.toml"), CELL);
let server;
let browser;
let page;

before(async () => {
  [server, browser] = await Promise.all([edited(folder), openBrowser({ width: 1366, height: 768 })]);
  page = browser.page;
  await showEdited(page, server.url);
  page.setDefaultTimeout(60_000);
});

after(async () => {
  await Promise.all([browser?.close(), server?.close()]);
  fs.rmSync(folder, { recursive: true });
});

const field = (name) => page.locator(`[data-field="${name}"]`);
const row = (list, k) => field(list).locator(`[data-field="${k}"]`);

async function pick(name) {
  await page.getByLabel("What is edited").selectOption({ label: name });
  await page.locator(".entry h2", { hasText: name }).waitFor();
}

async function fill(where, value) {
  await where.fill(value);
  await where.press("Enter");
}

/** Wait until nothing is being asked. */
const answered = () =>
  page.waitForFunction(() => !/checking/.test(document.querySelector(".edit-bar [role=status]").textContent));

/** Lines of the draft that the file has not, and those that it has more. */
async function changed() {
  await answered();
  const review = page.getByRole("button", { name: /Review/ });
  if (await review.isDisabled()) return [];
  await review.click();
  const lines = await page.locator(".review .added, .review .removed").allInnerTexts();
  await page.locator(".review").getByRole("button", { name: "Go on editing" }).click();
  return lines.map((line) => line.trim());
}

async function undo(times = 1) {
  for (let k = 0; k < times; k += 1) {
    await page.getByRole("button", { name: "Undo" }).click();
    await answered();
  }
}

test("numbers side by side are asked for when all are given, and taken away when none is", async () => {
  await pick("table");
  await page.getByLabel("Another option").selectOption("com");
  const com = field("com");
  await fill(com.getByLabel("com 1"), "0,1");
  await com.locator(".mistake", { hasText: "missing: 2, 3" }).waitFor();
  await fill(com.getByLabel("com 2"), "0");
  await com.locator(".mistake", { hasText: "missing: 3" }).waitFor();
  assert.deepEqual(await changed(), []);
  assert.equal(await com.getByLabel("com 1").inputValue(), "0,1");
  await fill(com.getByLabel("com 3"), "0");
  await com.locator(".mistake").waitFor({ state: "detached" });
  assert.deepEqual(await changed(), ["+com = [0.1, 0, 0]"]);
  for (const k of [1, 2, 3]) await fill(com.getByLabel(`com ${k}`), "");
  await answered();
  assert.deepEqual(await changed(), []);
  await undo(2);
});

test("a corner that is not whole stays as it was; one that is refused says so beside it", async () => {
  await pick("scanner");
  const corner = row("corners", 2);
  await fill(corner.getByLabel("2 1"), "");
  await corner.locator(".mistake", { hasText: "missing: 1" }).waitFor();
  assert.deepEqual(await changed(), []);
  await fill(corner.getByLabel("2 1"), "5000");
  await corner.locator(".mistake", { hasText: "1000" }).waitFor();
  assert.equal(await corner.getByLabel("2 1").inputValue(), "5000");
  assert.equal(await row("corners", 1).locator(".mistake").count(), 0);
  await fill(corner.getByLabel("2 1"), "2");
  await corner.locator(".mistake").waitFor({ state: "detached" });
  assert.deepEqual(await changed(), []);
});

test("two corners entered at once are both kept", async () => {
  await page.evaluate(() => {
    for (const [k, value] of [
      [1, "3"],
      [2, "3.5"],
    ]) {
      const input = document.querySelectorAll('[data-field="corners"] .one-item')[k].querySelector("input");
      input.value = value;
      for (const kind of ["input", "change"]) input.dispatchEvent(new Event(kind, { bubbles: true }));
    }
  });
  await answered();
  assert.ok((await changed()).includes("+corners = [[0, -1], [3, -1], [3.5, 1], [0, 1]]"));
  await undo(2);
});

test("a row is made up between two corners of a polygon and nowhere else", async () => {
  await page.getByLabel("Add: corners").click();
  await row("corners", 5).waitFor();
  assert.equal(await row("corners", 5).getByLabel("5 1").inputValue(), "0");
  await answered();
  await undo();
  await pick("forces");
  await page.getByLabel("Another option").selectOption("torque_limits");
  const limits = field("torque_limits");
  for (let k = 1; k <= 6; k += 1) {
    await limits.getByLabel("Add: torque_limits").click();
    for (const cell of [1, 2])
      assert.equal(await row("torque_limits", k).getByLabel(`${k} ${cell}`).inputValue(), "");
    await fill(row("torque_limits", k).getByLabel(`${k} 1`), String(-10 * k));
    await fill(row("torque_limits", k).getByLabel(`${k} 2`), String(10 * k));
    await answered();
  }
  // Of six joints, so none before the last is accepted: what was typed is kept until then.
  const pairs = [1, 2, 3, 4, 5, 6].map((k) => `[${-10 * k}, ${10 * k}]`);
  assert.deepEqual(await changed(), [`+torque_limits = [${pairs.join(", ")}]`]);
  await undo();
});

test("another kind of shape has no size until somebody types it, and the one before holds", async () => {
  await pick("table");
  const shape = field("shape");
  await shape.getByLabel("One of box").selectOption("sphere");
  const radius = shape.locator('[data-field="sphere"]').getByRole("textbox");
  assert.equal(await radius.inputValue(), "");
  await shape.getByText("box holds until sphere is given").waitFor();
  assert.deepEqual(await changed(), []);
  await shape.getByLabel("One of box").selectOption("box");
  assert.equal(await shape.getByLabel("box z").inputValue(), "0.74");
  await shape.getByLabel("One of box").selectOption("polygon");
  const at = [
    ["0", "0"],
    ["1", "0"],
    ["1", "1"],
  ];
  for (const [k, [x, y]] of at.entries()) {
    await shape.getByLabel("Add: polygon").click();
    await fill(row("polygon", k + 1).getByLabel(`${k + 1} 1`), x);
    await fill(row("polygon", k + 1).getByLabel(`${k + 1} 2`), y);
  }
  assert.deepEqual(await changed(), []);
  await fill(shape.getByLabel("height lower"), "0");
  await fill(shape.getByLabel("height upper"), "0,5");
  await shape.getByText("holds until").waitFor({ state: "detached" });
  assert.ok(
    (await changed()).some((line) => line.includes("polygon = [[0, 0], [1, 0], [1, 1]], height = [0, 0.5]")),
    (await changed()).join("\n"),
  );
  await undo();
  await shape.getByLabel("box z").waitFor();
});

test("words of a list may have blanks in them", async () => {
  await pick("contacts");
  await page.getByLabel("Another option").selectOption("excluded");
  await fill(field("excluded").getByRole("textbox"), "Skull and forehead; Face");
  await answered();
  assert.deepEqual(await changed(), ['+excluded = ["Skull and forehead", "Face"]']);
  await undo();
});

test("what was typed and taken away again follows the file; a value entered twice is the second", async () => {
  await pick("beside the table");
  const limit = field("limit").getByRole("textbox");
  await fill(limit, "0.6");
  await answered();
  await limit.press("End");
  await limit.press("5");
  await limit.press("Backspace");
  assert.equal(await limit.inputValue(), "0.6");
  await undo();
  await page.waitForFunction(() => document.querySelector('[data-field="limit"] input').value === "0.5");
  await page.evaluate(() => {
    const input = document.querySelector('[data-field="limit"] input');
    for (const value of ["0.6", "0.5"]) {
      input.value = value;
      for (const kind of ["input", "change"]) input.dispatchEvent(new Event(kind, { bubbles: true }));
    }
  });
  await answered();
  assert.equal(await limit.inputValue(), "0.5");
  assert.deepEqual(await changed(), []);
});

test("an item of which more than one key must be given stays until it is accepted, and its mistakes with it", async () => {
  await pick("scanner");
  await page.getByLabel("Add: fields").click();
  const added = row("fields", 2);
  await fill(added.getByLabel("name *"), "warning");
  await added.locator(".mistake").first().waitFor();
  assert.equal(await added.getByLabel("name *").inputValue(), "warning");
  // Without its row they are said of the list.
  await page.getByLabel("Take away: fields 2").click();
  await field("fields").locator("> .mistake").first().waitFor();
  await page.getByLabel("Add: fields").click();
  await fill(added.getByLabel("name *"), "warning");
  for (const [k, x, y] of [
    [1, "0", "-2"],
    [2, "3", "-2"],
    [3, "3", "2"],
  ]) {
    await added.getByLabel("Add: corners").click();
    const corner = added.locator(`[data-field="corners"] [data-field="${k}"]`);
    await fill(corner.getByLabel(`${k} 1`), x);
    await fill(corner.getByLabel(`${k} 2`), y);
    await answered();
  }
  await page.locator(".entry .mistake").first().waitFor({ state: "detached" });
  const lines = await changed();
  assert.ok(lines.includes('+name = "warning"'), lines.join("\n"));
  assert.ok(lines.includes("+corners = [[0, -2], [3, -2], [3, 2]]"), lines.join("\n"));
  assert.equal(await field("fields").locator("> .one-item").count(), 2);
  await undo();
});

test("nothing complained", () => {
  assert.deepEqual(browser.complaints, []);
});
