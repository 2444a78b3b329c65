// The workstation file edited in real pages of the real `seerob edit`: what is in the file in the end.

import assert from "node:assert/strict";
import fs from "node:fs";
import { createRequire } from "node:module";
import os from "node:os";
import path from "node:path";
import { after, before, test } from "node:test";
import { openBrowser } from "./browser.mjs";
import { edited, showEdited } from "./edited.mjs";
import { python } from "./python.mjs";

const AXE = fs.readFileSync(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");
const CELL = `# A cell; what nobody edits stays as it is, this line too.
title = "Edited"

[[parts]]
name = "table"            # beside the robot
shape = { box = [0.8, 1.4, 0.74] }
at = { position = [0.8, 0, 0.37] }  # its middle

# -- people --

[[humans]]
name = "operator"
stature = 1.75
mass = 75
sex = "male"
at = { position = [3, 0, 0] }

[[safety]]
kind = "minimum_distance"
name = "beside the table"
between = ["table", "operator"]
limit = 0.5               # [m]
`;
const MAKE_DOOR = `import sys; from pathlib import Path; sys.path.insert(0, "../tests/model_io")
import made_mechanisms as made
made.write(Path(sys.argv[1]), made.door()[0])`;
const folder = fs.mkdtempSync(path.join(os.tmpdir(), "seerob-edit-"));
const file = path.join(folder, "workstation.toml");
let server;
let browser;
let page;

before(async () => {
  fs.writeFileSync(file, CELL);
  [server, browser] = await Promise.all([edited(folder), openBrowser({ width: 1366, height: 768 })]);
  page = browser.page;
  await showEdited(page, server.url);
});

after(async () => {
  await Promise.all([browser?.close(), server?.close()]);
  fs.rmSync(folder, { recursive: true });
});

const saved = () => fs.readFileSync(file, "utf8");
const status = (where, word) => where.locator(".edit-bar [role=status]", { hasText: word }).waitFor();
/** Choose what is edited, and wait until that is what the fields are of. */
async function pick(name, where = page) {
  await where.getByLabel("What is edited").selectOption({ label: name });
  await where.locator(".entry h2", { hasText: name }).waitFor();
}

async function fill(where, value) {
  await where.fill(value);
  await where.press("Enter");
}

async function add(group, values, kind) {
  await page.getByLabel("Add", { exact: true }).selectOption(group);
  if (kind) await page.getByLabel("kind").selectOption(kind);
  for (const [name, value] of Object.entries(values))
    await fill(page.locator(".adding").getByLabel(name).first(), value);
  await page.getByRole("button", { name: "Add", exact: true }).click();
  await page.locator(".adding").waitFor({ state: "detached" });
}

async function review(action) {
  await page.getByRole("button", { name: /Review/ }).click();
  await page.getByRole("button", { name: action, exact: true }).click();
  await status(page, /^saved/);
}

test("an edit that makes the file wrong is refused beside its field, and the file stays", async () => {
  await pick("beside the table");
  const field = page.locator('[data-field="limit"]');
  await fill(field.getByRole("textbox"), "-1");
  await field.locator(".mistake").waitFor();
  assert.match(await field.locator(".mistake").innerText(), /-1/);
  assert.equal(await field.locator("[aria-invalid]").count(), 1);
  assert.equal(saved(), CELL);
  await fill(field.getByRole("textbox"), "0.5");
});

test("a robot, an area, a scanner and a criterion are added, saved and there after a reload", async () => {
  await add("robots", { "model *": "library:ur5e" });
  await add("areas", { "name *": "zone" });
  await add("sensors", { "name *": "scanner", range: "4", angle_deg: "190", resolution_deg: "0.5" });
  await add("safety", { "between 1": "robot", "between 2": "operator", limit: "0.3" }, "minimum_distance");
  assert.equal(saved(), CELL);
  await review("Save");
  const added = `[[robots]]
name = "robot"
model = "library:ur5e"
base = { position = [0, 0, 0] }`;
  const text = saved();
  assert.ok(text.includes(added), text);
  const before = CELL.split("\n").filter((line) => line !== "");
  const after = text.split("\n").filter((line) => line !== "");
  // All that was there is there, in its order; what is more are the four tables.
  const more = [];
  for (const line of after) {
    if (line === before[0]) before.shift();
    else more.push(line);
  }
  assert.deepEqual(before, [], text);
  assert.deepEqual(more.filter((line) => line.startsWith("[[")).sort(), [
    "[[areas]]",
    "[[robots]]",
    "[[safety]]",
    "[[sensors]]",
  ]);
  assert.ok(text.includes('between = ["robot", "operator"]\nlimit = 0.3\n'), text);
  await page.reload();
  await pick("scanner");
  await pick("zone");
  await page.getByRole("tab", { name: "Criteria" }).click();
  await page.waitForSelector('tr[data-criterion="minimum distance robot – operator"]');
  await page.getByRole("tab", { name: "Edit" }).click();
});

test("a shape is fields: its kind is chosen, sizes have names, and what is wrong is said beside it", async () => {
  const begun = saved();
  await pick("table");
  const shape = page.locator('[data-field="shape"]');
  assert.equal(await shape.getByLabel("box z").inputValue(), "0.74");
  await shape.getByLabel("One of box").selectOption("cylinder");
  await fill(shape.getByLabel("cylinder radius"), "0.3");
  await fill(shape.getByLabel("cylinder height"), "-1");
  await shape.locator(".mistake", { hasText: "larger than 0" }).waitFor();
  await fill(shape.getByLabel("cylinder height"), "0.7");
  await shape.locator(".mistake").waitFor({ state: "detached" });
  await review("Save");
  const round = "shape = { cylinder = [0.3, 0.7] }";
  assert.equal(saved(), begun.replace("shape = { box = [0.8, 1.4, 0.74] }", round));
  await pick("scanner");
  await page.locator('[data-field="corners"]').getByLabel("Add: corners").click();
  await page.locator('[data-field="corners"] .one-item').nth(4).waitFor();
  await page.getByLabel("Take away: corners 5").click();
  await page.locator('[data-field="corners"] .one-item').nth(4).waitFor({ state: "detached" });
  for (let k = 0; k < 3; k += 1) await page.getByRole("button", { name: "Undo" }).click();
  await pick("table");
  await shape.getByLabel("box z").waitFor();
  await review("Save");
  assert.equal(saved(), begun);
});

test("what is dragged by a handle is where it was put, in steps, and undo gives back the file byte for byte", async () => {
  const begun = saved();
  await pick("table");
  const steps = page.getByLabel("Steps");
  await steps.selectOption({ label: "100 mm, 15°" });
  const [from, to] = await page.evaluate(() => [
    window.seerob.project([0.8, 0, 0.37]),
    window.seerob.project([1.8, 0, 0.37]),
  ]);
  const length = Math.hypot(to[0] - from[0], to[1] - from[1]);
  const along = (px) => [0, 1].map((k) => from[k] + ((to[k] - from[k]) / length) * px);
  let px = 20;
  for (; px < 120; px += 4) {
    await page.mouse.move(...along(px));
    if (await page.evaluate(() => window.seerob.held)) break;
  }
  assert.ok(px < 120, "no handle on the way");
  await page.mouse.move(...along(px + 8));
  await page.mouse.down();
  await page.mouse.move(...along(px + 8 + length / 2), { steps: 6 });
  const carried = await page.evaluate(() => window.seerob.pose("table").position[0]);
  await page.mouse.up();
  await status(page, /^not saved/);
  const x = Number(await page.getByLabel("x [m]").inputValue());
  assert.ok(x > 0.9 && Math.abs(x * 10 - Math.round(x * 10)) < 1e-9, String(x));
  assert.ok(Math.abs(carried - x) < 1e-6, `${carried} was shown, ${x} is in the file`);
  await fill(page.getByLabel("yaw [°]"), "30");
  await page.waitForFunction(
    () => document.querySelector(".edit-bar [role=status]").textContent === "not saved",
  );
  await review("Save");
  const place = `at = { position = [${x}, 0, 0.37], rpy_deg = [0, 0, 30] }  # its middle`;
  assert.equal(saved(), begun.replace("at = { position = [0.8, 0, 0.37] }  # its middle", place));
  await page
    .locator(".room canvas")
    .focus()
    .catch(() => {});
  for (let k = 0; k < 2; k += 1) await page.getByRole("button", { name: "Undo" }).click();
  await page.waitForFunction(
    () => document.querySelector(".edit-bar [role=status]").textContent === "not saved",
  );
  await page.waitForFunction(() => [...document.querySelectorAll(".numbers input")][0].value === "0.8");
  await review("Save");
  assert.equal(saved(), begun);
});

test("a coordinate keeps what is being typed while others edit, and two angles entered at once are both kept", async () => {
  const begun = saved();
  await pick("operator");
  const y = page.getByLabel("y [m]");
  const stature = page.locator('[data-field="stature"]').getByRole("textbox");
  await y.fill("0.25");
  await page.evaluate(() => {
    window.answers = 0;
    new MutationObserver(() => {
      window.answers += 1;
    }).observe(document.querySelector(".edit-bar [role=status]"), {
      childList: true,
      subtree: true,
      characterData: true,
    });
    const field = document.querySelector('[data-field="stature"] input');
    field.value = "1.8";
    for (const kind of ["input", "change"]) field.dispatchEvent(new Event(kind, { bubbles: true }));
  });
  await page.waitForFunction(() => window.answers >= 2);
  await status(page, /^not saved/);
  assert.equal(await stature.inputValue(), "1.8");
  assert.equal(await y.inputValue(), "0.25");
  await page.evaluate(() => {
    const fields = document.querySelectorAll(".numbers input");
    for (const [k, value] of [
      [3, "10"],
      [4, "20"],
    ]) {
      fields[k].value = value;
      for (const kind of ["input", "change"]) fields[k].dispatchEvent(new Event(kind, { bubbles: true }));
    }
  });
  await y.press("Enter");
  await status(page, /^not saved/);
  await review("Save");
  const round = "at = { position = [3, 0.25, 0], rpy_deg = [10, 20, 0] }";
  const place = "at = { position = [3, 0, 0] }";
  assert.equal(saved(), begun.replace("stature = 1.75", "stature = 1.8").replace(place, round));
  for (let k = 0; k < 4; k += 1) await page.getByRole("button", { name: "Undo" }).click();
  await page.waitForFunction(() => document.querySelectorAll(".numbers input")[1].value === "0");
  await review("Save");
  assert.equal(saved(), begun);
});

test("the first waypoint of a robot brings its source, whose figures nobody assumes; the next is a place", async () => {
  const begun = saved();
  const added = page.locator(".adding");
  const next = async (key) => {
    await page.getByLabel("Add", { exact: true }).selectOption("waypoints");
    await added.locator(`[data-field="${key}"]`).waitFor();
  };
  await next("q_deg");
  await page.getByRole("button", { name: "Add", exact: true }).click();
  await added.locator('[data-field="joint_speed"] .mistake').waitFor();
  await fill(added.getByLabel("q_deg"), "[0, -80, 90, -100, -90, 0]");
  for (const [key, value] of Object.entries({ joint_speed: 1, joint_acceleration: 2, joint_jerk: 20 }))
    await fill(added.getByLabel(`${key} [rad/s`), String(value));
  await page.getByRole("button", { name: "Add", exact: true }).click();
  await page.locator(".entry h2", { hasText: "robot: point_1" }).waitFor();
  await next("at");
  await page.getByRole("button", { name: "Add", exact: true }).click();
  await page.locator(".entry h2", { hasText: "robot: point_2" }).waitFor();
  await fill(page.getByLabel("z [m]"), "0.5");
  await page.getByRole("button", { name: /Review/ }).click();
  await page.locator(".review .added", { hasText: ", 0.5]," }).waitFor();
  const lines = (await page.locator(".review .added").allInnerTexts()).map((line) => line.trim());
  await page.getByRole("button", { name: "Discard", exact: true }).click();
  await status(page, /^saved/);
  assert.ok(lines.includes("+q_deg = [0, -80, 90, -100, -90, 0]"), lines.join("\n"));
  assert.match(lines.at(-1), /^\+at = \{ position = \[0\.\d+, 0\.\d+, 0\.5\], rpy_deg = /);
  assert.equal(saved(), begun);
});

test("a distance that is measured is what a criterion says of the two, and Escape ends it", async () => {
  await page.keyboard.press("Escape");
  await page.getByRole("button", { name: "Measure" }).click();
  const top = await page.evaluate(() => window.seerob.project([0.8, 0, 0.74]));
  await page.mouse.click(...top);
  await page.locator(".measure-note", { hasText: "table, and the second one" }).waitFor();
  await page.locator(".tree").getByRole("button", { name: "operator", exact: true }).click();
  await page.locator(".measure-note strong").waitFor();
  const said = await page.locator(".measure-note strong").innerText();
  // A criterion asks the same of the two.
  await page.getByRole("tab", { name: "Criteria" }).click();
  const row = await page.locator('tr[data-criterion="beside the table"]').innerText();
  const asked = Number(row.match(/\d+\.\d+/)[0]);
  assert.ok(Math.abs(Number.parseFloat(said) - asked) <= 0.011, `${said}; ${row}`);
  await page.getByRole("tab", { name: "Edit" }).click();
  await page.keyboard.press("Escape");
  await page.locator(".measure-note").waitFor({ state: "detached" });
});

test("two pages edit at once and lose nothing of each other", async () => {
  const other = await browser.context.newPage();
  await showEdited(other, server.url);
  await pick("table");
  await pick("operator", other);
  await Promise.all([fill(page.getByLabel("y [m]"), "0.25"), fill(other.getByLabel("x [m]"), "3.5")]);
  for (const where of [page, other]) await status(where, /^not saved/);
  await page.waitForFunction(() => document.querySelector(".editor") !== null);
  await pick("operator");
  await page.waitForFunction(() => document.querySelector(".numbers input").value === "3.5");
  await review("Save");
  await status(other, /^saved/);
  assert.ok(saved().includes("at = { position = [0.8, 0.25, 0.37] }  # its middle"), saved());
  assert.ok(saved().includes("at = { position = [3.5, 0, 0] }"), saved());
  await other.close();
});

test("a draft is run, its run follows an edit, and the file stays", async () => {
  const begun = saved();
  await page.getByRole("button", { name: "Run", exact: true }).click();
  await page.locator(".source", { hasText: "a draft, not recorded" }).waitFor();
  await page.waitForFunction(() => window.seerob.t > 0.2);
  // Also where the run falls behind real time.
  assert.match(await page.locator(".source [role=status]").innerText(), /^live – a draft, not recorded/);
  assert.match(await page.locator(".pill strong").innerText(), /DRAFT/);
  await pick("table");
  const before = await page.evaluate(() => window.seerob.pose("table").position[0]);
  await fill(page.getByLabel("x [m]"), "1.1");
  await page.waitForFunction(
    (x) => window.seerob.pose("table").position[0] > x + 0.2 && window.seerob.t > 0.05,
    before,
  );
  await page.locator(".entry h2", { hasText: "table" }).waitFor();
  await page.getByRole("button", { name: "Stop", exact: true }).click();
  await page.locator(".not-run").waitFor();
  await page.getByRole("button", { name: "Undo" }).click();
  await page.waitForFunction((x) => window.seerob.pose("table").position[0] === x, before);
  assert.equal(saved(), begun);
});

test("what others speak of is removed with them, or not at all", async () => {
  const begun = saved();
  await pick("zone");
  await page.getByRole("button", { name: "Copy", exact: true }).click();
  await page.locator(".entry h2", { hasText: "zone_2" }).waitFor();
  await page.getByRole("button", { name: "Remove", exact: true }).click();
  await page.locator(".entry").waitFor({ state: "detached" });
  await pick("table");
  await page.getByRole("button", { name: "Remove", exact: true }).click();
  await page.getByRole("button", { name: "Remove with safety[0]" }).click();
  await page.locator(".entry").waitFor({ state: "detached" });
  await page.getByRole("button", { name: /Review/ }).click();
  assert.ok(
    (await page.locator(".review .removed").allInnerTexts()).some((line) =>
      line.startsWith('-name = "table"'),
    ),
  );
  await page.getByRole("button", { name: "Discard", exact: true }).click();
  await status(page, /^saved/);
  assert.equal(saved(), begun);
});

test("a section takes away what lies beyond it, also for clicks; panels are placed, fold and views are kept", async () => {
  await page.keyboard.press("Escape");
  await page.getByRole("button", { name: "View", exact: true }).click();
  const panel = page.locator(".view-panel");
  const at = await page.evaluate(() => window.seerob.project([0.8, 0, 0.74]));
  const clicked = async () => {
    await page.mouse.click(...at);
    return page.evaluate(() => document.querySelector(".entry h2")?.textContent ?? null);
  };
  assert.equal(await clicked(), "table");
  await page.keyboard.press("Escape");
  await panel.getByLabel("Section").selectOption("z");
  await panel.getByRole("slider").fill("0.3");
  assert.equal(await clicked(), null);
  await panel.getByLabel("Section").selectOption("no section");
  // Of a body that stands still, a speed is never told from one instant.
  await panel.getByLabel("Speed of a point").check();
  await page.mouse.click(...at);
  await page.locator(".measure-note", { hasText: "table (" }).waitFor();
  assert.match(await page.locator(".measure-note").innerText(), /two instants/);
  await panel.getByLabel("Speed of a point").uncheck();
  await panel.getByRole("button", { name: "Save view" }).click();
  const pixel = () => page.evaluate(() => window.seerob.project([0.8, 0, 0.74]).map(Math.round));
  const box = (of) => page.locator(of).boundingBox();
  const { width } = await box(".left");
  await page.getByRole("separator", { name: "Width of Scene and properties" }).focus();
  await page.keyboard.press("ArrowRight");
  await page.waitForFunction((was) => document.querySelector(".left").offsetWidth >= was + 15, width);
  const grip = (name) => page.getByRole("button", { name: `Place of ${name}` });
  const drag = async (name, x, y) => {
    await grip(name).hover();
    await page.mouse.down();
    await page.mouse.move(x, y, { steps: 4 });
    await page.mouse.up();
  };
  const before = await box(".room");
  await drag("Results", before.x + before.width / 4, before.y + 20);
  await page.waitForFunction((x) => document.querySelector(".room").getBoundingClientRect().x > x, before.x);
  await drag("Plots and time", before.x + before.width / 2, before.y + 20);
  await page.waitForFunction(() => document.querySelector(".app").classList.contains("time-above"));
  await panel.getByLabel("Results", { exact: true }).uncheck();
  await page.locator(".right").waitFor({ state: "hidden" });
  await page.reload();
  await page.waitForFunction(() => Number.isFinite(window.seerob?.t));
  await page.locator(".right").waitFor({ state: "hidden" });
  await page.getByRole("button", { name: "View", exact: true }).click();
  await panel.getByLabel("Results", { exact: true }).check();
  const [left, results, room, time] = await Promise.all([".left", ".right", ".room", ".bottom"].map(box));
  assert.ok(Math.abs(left.width - width - 16) < 2, `${left.width}, was ${width}`);
  assert.ok(
    left.x < results.x && results.x < room.x && time.y < room.y,
    JSON.stringify([left, results, room, time]),
  );
  await grip("Results").press("ArrowRight");
  await grip("Plots and time").press("ArrowDown");
  await page.getByRole("separator", { name: "Width of Scene and properties" }).press("Home");
  await page.waitForFunction((was) => document.querySelector(".left").offsetWidth < was + 2, width);
  await page.getByRole("button", { name: "Top", exact: true }).click();
  const fromAbove = await pixel();
  await panel.getByLabel("Saved views").selectOption({ label: "view 1" });
  await page.waitForFunction(
    (there) => String(window.seerob.project([0.8, 0, 0.74]).map(Math.round)) !== there,
    String(fromAbove),
  );
  assert.ok(Math.hypot(...(await pixel()).map((x, k) => x - at[k])) < 3, `${await pixel()}, was ${at}`);
  await panel.getByRole("button", { name: "Forget" }).click();
  await page.keyboard.press("Escape");
});

test("a CAD file that is dropped becomes parts, an axis that is accepted a mechanism", async () => {
  const begun = saved();
  const made = python("-c", MAKE_DOOR, path.join(folder, "door.step"));
  made.stdout.resume();
  await new Promise((resolve) => made.once("exit", resolve));
  const step = fs.readFileSync(path.join(folder, "door.step"), "utf8");
  const drop = async (files) => {
    const dataTransfer = await page.evaluateHandle((all) => {
      const data = new DataTransfer();
      for (const [name, text] of all) data.items.add(new File([text], name));
      return data;
    }, files);
    await page.dispatchEvent(".room", "drop", { dataTransfer });
  };
  const told = page.locator(".bringing");
  await drop([
    ["a.step", step],
    ["b.step", step],
  ]);
  await told.getByText("none of these names the others").waitFor();
  // The panel that tells of it opens by itself.
  await page.getByRole("tab", { name: "Findings" }).click();
  // Dragged in from the desktop, as the browser itself takes files of the system.
  const beside = path.join(folder, "the hinge.stp");
  const whole = path.join(folder, "a door.STEP");
  fs.writeFileSync(beside, step);
  fs.writeFileSync(whole, step.replace("HEADER;", "/* the hinge.stp */ HEADER;"));
  const cdp = await page.context().newCDPSession(page);
  const box = await page.locator(".room canvas").boundingBox();
  const over = { x: box.x + box.width / 2, y: box.y + box.height / 2 };
  const data = { items: [], files: [beside, whole], dragOperationsMask: 1 };
  for (const type of ["dragEnter", "dragOver"])
    await cdp.send("Input.dispatchDragEvent", { type, ...over, data });
  await cdp.send("Input.dispatchDragEvent", { type: "drop", ...over, data });
  await told.getByText("a_door.step: 2 parts, in the draft").waitFor();
  assert.ok(fs.existsSync(path.join(folder, "imported/a_door/the hinge.stp")));
  await page.waitForFunction(() => window.seerob.pose("door/leaf") !== null);
  const hinge = told.locator(".axes label", { hasText: "on one axis" }).first();
  await hinge.getByRole("checkbox").check();
  assert.match(await hinge.innerText(), /door\/leaf → door\/frame|door\/frame → door\/leaf/);
  await told.getByRole("button", { name: "Accept what is marked" }).click();
  await told.getByText("a_door.step: 1 parts and 1 mechanisms, in the draft").waitFor();
  await page.waitForFunction(() => window.seerob.pose("door/frame") !== null);
  assert.equal(saved(), begun);
  await review("Save");
  assert.match(saved(), /\[\[robots\]\]\nname = "a_door"\nmodel = "imported\/a_door\/robots\//);
  for (let k = 0; k < 2; k += 1) await page.getByRole("button", { name: "Undo" }).click();
  await page.waitForFunction(() => window.seerob.pose("door/frame") === null);
  await review("Save");
  assert.equal(saved(), begun);
});

test("a picture, and the figures of the instant, are what is shown", async () => {
  await page.getByRole("button", { name: "View", exact: true }).click();
  const taken = async (name) => {
    const [download] = await Promise.all([
      page.waitForEvent("download"),
      page.getByRole("button", { name, exact: true }).click(),
    ]);
    return fs.readFileSync(await download.path());
  };
  const size = () =>
    page.evaluate(() => [...document.querySelectorAll(".room canvas")].map((c) => [c.width, c.height])[0]);
  // Pixels get larger or smaller meanwhile where pictures come slowly.
  const before = await size();
  const picture = await taken("Picture");
  assert.equal(picture.subarray(1, 4).toString(), "PNG");
  const sizes = [before, await size()].map(String);
  assert.ok(sizes.includes(String([picture.readUInt32BE(16), picture.readUInt32BE(20)])));
  const told = JSON.parse(await taken("Figures (JSON)"));
  const table = (await taken("Figures (CSV)")).toString().trim().split("\r\n");
  assert.equal(table.length, told.results.length + 1);
  const near = told.results.find(({ name }) => name === "beside the table");
  assert.deepEqual([near.unit, near.limit, near.verdict], ["m", 0.5, "within"]);
  assert.ok(
    table.some((row) => row.startsWith(`0,beside the table,${near.value},m,0.5,false,within,`)),
    table.join("\n"),
  );
  await page.getByRole("button", { name: "View", exact: true }).click();
});

test("the page speaks the chosen language and writes the chosen units, and remembers both", async () => {
  await page.getByLabel("Language").selectOption({ label: "Deutsch" });
  await page.getByRole("tab", { name: "Kriterien" }).click();
  await page.getByLabel("Längen").selectOption("mm");
  const row = page.locator('tr[data-criterion="beside the table"]');
  const millimetres = await row.locator(".value").innerText();
  assert.match(await row.innerText(), /mm[\s\S]*innerhalb/);
  await page.reload();
  await page.getByRole("button", { name: "Prüfen und speichern" }).waitFor();
  await page.getByRole("tab", { name: "Kriterien" }).click();
  await page.getByLabel("Längen").selectOption("m");
  await page.getByLabel("Sprache").selectOption({ label: "English" });
  const metres = await row.locator(".value").innerText();
  assert.ok(Math.abs(Number(millimetres) - 1000 * Number(metres)) < 0.11, `${millimetres} mm, ${metres} m`);
  await page.getByRole("tab", { name: "Edit" }).click();
});

test("axe finds no fault in the panels, at a desk and on a phone held either way, dark and light", async () => {
  await page.evaluate(AXE);
  const found = [];
  const sizes = { desk: [1366, 768], upright: [390, 844], across: [844, 390] };
  const look = async (state) => {
    for (const colorScheme of ["dark", "light"]) {
      await page.emulateMedia({ colorScheme });
      await page.waitForFunction((theme) => document.documentElement.dataset.theme === theme, colorScheme);
      for (const [size, [width, height]] of Object.entries(sizes).reverse()) {
        await page.setViewportSize({ width, height });
        const { violations } = await page.evaluate(() =>
          globalThis.axe.run(document, { resultTypes: ["violations"] }),
        );
        const faults = violations.map(({ id, nodes }) => `${id} ${nodes[0].target}`);
        found.push(...faults.map((fault) => `${state}, ${colorScheme}, ${size}: ${fault}`));
      }
    }
  };
  await page.getByRole("button", { name: "View", exact: true }).click();
  await page.locator(".view-panel").getByLabel("Section").selectOption("x");
  await look("the view's panel");
  await page.locator(".view-panel").getByLabel("Section").selectOption("no section");
  await page.getByRole("button", { name: "View", exact: true }).click();
  await pick("table");
  await look("a part");
  await fill(page.locator('[data-field="name"] input'), "no name");
  await page.locator(".mistake").first().waitFor();
  await look("refused");
  const add = page.getByLabel("Add", { exact: true });
  const kinds = await add.locator("option").evaluateAll((all) => all.map((one) => one.value).filter(Boolean));
  assert.ok(kinds.length > 8, kinds.join());
  for (const kind of kinds) {
    await add.selectOption(kind);
    if (kind === "safety") await page.getByLabel("kind").selectOption("separation");
    await look(`${kind}: one is added`);
    await page.getByRole("button", { name: "Cancel" }).click();
  }
  await fill(page.getByLabel("x [m]"), "0.85");
  await status(page, /^not saved/);
  await page.getByRole("button", { name: /Review/ }).click();
  await look("reviewed");
  await page.getByRole("button", { name: "Discard", exact: true }).click();
  await status(page, /^saved/);
  assert.deepEqual(found, []);
});

test("nothing complained, and nothing was asked of another origin", () => {
  assert.deepEqual(browser.complaints, []);
  assert.deepEqual(browser.outside, []);
});
