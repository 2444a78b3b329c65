// Design in place: hands of an emulated headset move what a real `seerob edit` has, teach a waypoint and measure.

import assert from "node:assert/strict";
import fs from "node:fs";
import os from "node:os";
import path from "node:path";
import { after, before, test } from "node:test";
import { openBrowser } from "./browser.mjs";
import { edited, showEdited } from "./edited.mjs";
import { HEADSET, pictures, pressInRoom, put, trigger } from "./emulated_headset.mjs";

const CELL = `# What nobody moves stays as it is, this line too.
title = "Designed in place"

[[robots]]
name = "ur10"
model = "library:ur10"
base = { position = [0, 0, 0.7] }   # on a pillar

[[parts]]
name = "table"
shape = { box = [0.6, 0.8, 0.7] }
at = { position = [1.4, 0, 0.35] }

[[parts]]
name = "shelf"
shape = { box = [0.2, 0.2, 0.2] }
at = { position = [1.4, 1.2, 0.5] }

[[sensors]]
name = "scanner"
at = { position = [0.5, -1.2, 0.3], rpy_deg = [0, 0, -90] }  # beside the pillar
capability_mm = 70
response_ms = 80
source = "made up"
[sensors.laser_scanner]
range = 2.0
angle_deg = 190
resolution_deg = 0.5
[[sensors.laser_scanner.fields]]
name = "protective"
corners = [[0, -0.8], [0.9, -0.8], [0.9, 0.8], [0, 0.8]]

[[humans]]
name = "operator"
stature = 1.75
mass = 75
sex = "male"
at = { position = [3, 0, 0] }

[[sources]]
kind = "waypoints"
robot = "ur10"
joint_speed = 0.8
joint_acceleration = 1.2
joint_jerk = 12.0

[[sources.points]]
name = "home"
q_deg = [0, -70, 80, -100, -90, 0]

[[sources.points]]
name = "aside"
q_deg = [30, -70, 80, -100, -90, 0]

[[safety]]
kind = "minimum_distance"
name = "beside the table"
between = ["table", "operator"]
limit = 0.5
`;
const HEAD = [0, 1.6, 0];
const folder = fs.mkdtempSync(path.join(os.tmpdir(), "seerob-design-"));
const file = path.join(folder, "workstation.toml");
const saved = () => fs.readFileSync(file, "utf8");
let server;
let browser;
let page;

before(async () => {
  fs.writeFileSync(file, CELL);
  [server, browser] = await Promise.all([edited(folder), openBrowser({ width: 480, height: 320 })]);
  page = browser.page;
  await page.addInitScript(HEADSET);
  await showEdited(page, server.url);
  page.setDefaultTimeout(120_000);
  await page.evaluate(() =>
    [...document.querySelectorAll("button")].find((b) => b.textContent === "enter VR").click(),
  );
  await page.waitForFunction(() => window.headset.activeSession && window.seerob.visited([0, 0, 0]), null, {
    polling: 50,
  });
  await put(page, HEAD);
  await page.evaluate(() => window.put(1, [-0.2, 1.1, -0.5]));
  await pictures(page, 4);
});

after(async () => {
  await Promise.all([browser?.close(), server?.close()]);
  fs.rmSync(folder, { recursive: true });
});

const press = (label) => pressInRoom(page, label, HEAD);
const inRoom = (point) => page.evaluate((p) => window.seerob.inRoom(p), point);
/** Where a body is in the cell (z up) [m]. */
const at = async (name) => {
  const [x, y, z] = await page.evaluate((n) => window.seerob.pose(n).position, name);
  return [x, -z, y];
};
const yUp = ([x, y, z]) => [x, z, -y];

/** The right hand so high above a point of the cell [m], pointing down. */
async function above(point, high = 0.5) {
  const [x, y, z] = await inRoom(yUp(point));
  await put(page, HEAD, [x, y + high, z], [0, -1, 1e-6]);
  await pictures(page, 2);
}

/** Take what is at a point of the cell and carry it by so much [m]. */
async function carry(point, by, high = 0.5) {
  await above(point, high);
  await trigger(page, 1);
  await above(
    point.map((v, i) => v + by[i]),
    high,
  );
  await trigger(page, 0);
}

/** Wait until the board says that of the file; what is being asked just now is drawn within a fifth of a second. */
async function status(word) {
  await page.waitForTimeout(250);
  await pictures(page, 2);
  await page.waitForFunction((w) => window.seerob.panels.includes(w), word, { polling: 50 });
}

/** Save as one does in the room: what changes is shown first. */
async function save() {
  await press("review, then save");
  await press("save");
  await status("saved");
  await press("review");
  return saved();
}

test("a scanner is put elsewhere by hand, back by undo, and saved as one line", {
  timeout: 900_000,
}, async () => {
  await press("design");
  // By its field, in which the hand is: beams go through it.
  await carry([0.5, -1.7, 0.3], [0.3, -0.2, 0], 0);
  await status("not saved");
  assert.equal(saved(), CELL);
  await page.waitForFunction(
    () => Math.abs(window.seerob.pose("scanner/protective").position[0] - 0.8) < 1e-6,
  );
  await press("undo");
  await status("saved");
  await carry([0.5, -1.7, 0.3], [0.304, -0.2, 0], 0);
  await status("not saved");
  // In steps of 10 mm, as the handles on the desk go.
  assert.equal(await save(), CELL.replace("[0.5, -1.2, 0.3]", "[0.8, -1.4, 0.3]"));
});

test("a turned hand turns a table about one axis of the cell", { timeout: 900_000 }, async () => {
  const before = saved();
  await press("turn");
  await above([1.4, 0, 0.7]);
  await trigger(page, 1);
  // By 30 degrees about what points down: the beam stays where it is.
  await page.evaluate(() => {
    const { quaternion } = window.headset.controllers.right;
    const [s, c] = [Math.sin(Math.PI / 12), Math.cos(Math.PI / 12)];
    const { x, y, z, w } = quaternion;
    quaternion.set(c * x + s * z, c * y + s * w, c * z - s * x, c * w - s * y);
  });
  await pictures(page, 2);
  await trigger(page, 0);
  await status("not saved");
  await press("turn");
  const wanted = before.replace("[1.4, 0, 0.35] }", "[1.4, 0, 0.35], rpy_deg = [0, 0, 30] }");
  assert.equal((await save()).replace("30.0]", "30]").replaceAll("0.0,", "0,"), wanted);
});

test("a waypoint is taught by carrying the tool, and refused where the arm does not reach", {
  timeout: 900_000,
}, async () => {
  const before = saved();
  await press("teach");
  const tip = await at("ur10/wrist_3_link");
  await carry(tip, [0, -0.1, 0.05]);
  await status("not saved");
  const after = await save();
  assert.ok(after.startsWith(before.slice(0, before.indexOf("[[safety]]") - 1)), "what was there stays");
  const [, text] = after.match(/name = "taught_3"\nmove = "joint"\nat = \{ position = \[([^\]]+)\]/);
  const off = text.split(",").map((v, i) => Number(v) - (tip[i] + [0, -0.1, 0.05 - 0.7][i]));
  assert.ok(Math.hypot(...off) < 1e-3, `${text} is ${off} beside where the tool was let go`);
  await carry(await at("ur10/wrist_3_link"), [4, 0, 0]);
  await page.waitForFunction(
    () => window.seerob.panels.some((line) => /cannot be brought/.test(line)),
    null,
    {
      polling: 50,
    },
  );
  assert.equal(saved(), after);
  await press("design");
});

test("the ruler asks the engine for the least distance of two surfaces", { timeout: 900_000 }, async () => {
  await press("ruler");
  for (const point of [
    [1.4, 0, 0.7],
    [1.4, 1.2, 0.6],
  ]) {
    await above(point);
    await trigger(page, 1);
    await trigger(page, 0);
  }
  // The table was turned by 30 degrees since: its corner is nearest.
  const corner = 0.3 * Math.sin(Math.PI / 6) + 0.4 * Math.cos(Math.PI / 6);
  const x = 0.3 * Math.cos(Math.PI / 6) - 0.4 * Math.sin(Math.PI / 6);
  const least = Math.hypot(1.1 - corner, Math.max(0, Math.abs(x) - 0.1));
  await page.waitForFunction(() => window.seerob.panels.some((line) => /^\d[\d.]*\sm$/.test(line)), null, {
    polling: 50,
  });
  const said = await page.evaluate(() => window.seerob.panels.find((line) => /^\d[\d.]*\sm$/.test(line)));
  assert.ok(Math.abs(Number.parseFloat(said) - least) < 1e-3, `${said} instead of ${least} m`);
  await press("ruler");
  assert.deepEqual([browser.complaints, browser.outside], [[], []]);
});

test("a waypoint is placed by numbers on the desk, and a copy of it comes behind it", async () => {
  const desk = await browser.context.newPage();
  await showEdited(desk, server.url);
  const before = saved();
  const [, x, y, z] = before.match(/name = "taught_3"[^[]*\[([-\d.]+), ([-\d.]+), ([-\d.]+)\]/).map(Number);
  const undo = desk.getByRole("button", { name: "Undo" });
  await desk.getByLabel("What is edited").selectOption({ label: "ur10: taught_3" });
  const height = desk.locator(".place").getByLabel(/^z/);
  await height.fill(String(z + 0.02));
  await height.press("Enter");
  await undo.and(desk.locator(":enabled")).waitFor();
  await desk.getByRole("button", { name: "Copy", exact: true }).click();
  await desk
    .getByLabel("What is edited")
    .getByRole("option", { name: "ur10: 4" })
    .waitFor({ state: "attached" });
  await desk.getByRole("button", { name: /Review/ }).click();
  const diff = await desk.locator(".review pre").innerText();
  const place = (dz) => `position = [${x}, ${y}, ${Number((z + dz).toFixed(4))}]`;
  assert.ok(diff.includes(place(0.02)) && diff.includes(place(0.07)), diff);
  await desk.getByRole("button", { name: "Discard" }).click();
  await desk.locator(".edit-bar [role=status]", { hasText: /^saved/ }).waitFor();
  assert.equal(saved(), before);
  await desk.close();
});
