// By hand (node --test tests/headset_room.soak.mjs), on a machine that keeps real time: a visitor who works in a real run:
// takes a workpiece, puts it into a box, pulls a lever; then the run again. Beside other work hands swing, and it fails.
import assert from "node:assert/strict";
import fs from "node:fs";
import os from "node:os";
import path from "node:path";
import { createInterface } from "node:readline";
import { after, before, test } from "node:test";
import { openBrowser } from "./browser.mjs";
import { HEADSET, pictures, put } from "./emulated_headset.mjs";
import { askPython, python } from "./python.mjs";

const CELL = `
title = "Parts by hand"
variables = "variables.toml"
[[parts]]
name = "table"
shape = { box = [0.8, 1.6, 0.8] }
at = { position = [0, 0, 0.4] }
[[machines]]
name = "valve"
shape = { box = [0.04, 0.04, 0.3] }
mass = 0.5
at = { position = [0.3, 0.45, 1.0] }
turn = { about = [0, 1, 0], angle = "valve/angle", lower = 0.0, upper = 1.2 }
[[controls]]
name = "valve_lever"
of = "valve"
kind = "lever"
sets = "valve/angle"
upper = 1.2
[[workpieces]]
name = "blank"
shape = { box = [0.08, 0.06, 0.05] }
mass = 0.8
at = { position = [0.3, -0.2, 0.826] }
torn = 0.6
[[places]]
name = "box"
at = { position = [0.3, 0.3, 0.9] }
size = [0.9, 0.7, 0.4]
ends_round = true
[[humans]]
name = "operator"
stature = 1.75
mass = 75
sex = "male"
unseen_uncertainty_mm = 100
at = { position = [0.9, 0, 0], rpy_deg = [0, 0, 180] }
[[sources]]
kind = "headset"
human = "operator"
timeout = 2
hold = 2
at = { position = [0.9, 0, 0], rpy_deg = [0, 0, 180] }
[[sources]]
kind = "room"
name = "room"
timeout = 2
[[safety]]
kind = "minimum_distance"
name = "operator – table"
limit = 0.01
between = ["operator", "table"]
[[safety]]
kind = "minimum_distance"
name = "blank – table"
between = ["blank", "table"]
`;
const VARIABLES = `
[[variables]]
name = "valve/angle"
source = "room"
address = "valve_lever"
unit = "rad"
timeout = 2
`;
const AGAIN = `
import json, sys
from pathlib import Path
import numpy as np
from seerob import Recording
from seerob.outputs.sink import Closing
from seerob.session.station import load_recorded
path = Path(json.load(sys.stdin))
recording = Recording.open(path)
class Again(Closing):
    snapshots = []
    def write(self, snapshot, samples):
        self.snapshots.append(snapshot)
load_recorded(recording).replay(recording, writers=[again := Again()], sinks=())
def said(snapshots):
    return {s.seq: (s.poses, s.events, [(r.name, r.value, r.verdict, r.reason) for r in s.results]) for s in snapshots}
one, two = said(recording.snapshots()), said(again.snapshots)
grabs = [s.piece for tick in recording.ticks() for s in tick.samples if type(s).__name__ == "GrabSample"]
head = [node.name for node in recording.scene.nodes].index("operator/head")
places = {s.seq: np.frombuffer(s.poses, "<f4").reshape(-1, 7)[head, :3] for s in again.snapshots if s.results[0].verdict in ("within", "exceeded")}
steps = [float(np.linalg.norm(places[k + 1] - places[k])) for k in places if k + 1 in places]
print(json.dumps({"fastest": max(steps) / recording.scene.period, "ticks": len(one), "same": all(two.get(k) == v for k, v in one.items()), "grabs": grabs,
    "events": [e.what for s in again.snapshots for e in s.events]}))
`;

let folder;
let run;
let browser;
let page;

before(async () => {
  folder = fs.mkdtempSync(path.join(os.tmpdir(), "seerob-room-"));
  fs.writeFileSync(path.join(folder, "workstation.toml"), CELL);
  fs.writeFileSync(path.join(folder, "variables.toml"), VARIABLES);
  run = python("-m", "seerob", "run", folder, "--port", "0", "-o", path.join(folder, "out"));
  browser = await openBrowser({ width: 900, height: 560 });
  page = browser.page;
  await page.addInitScript(HEADSET);
  for await (const line of createInterface({ input: run.stdout })) {
    const [url] = line.match(/http:\/\/\S+/) ?? [];
    if (!url) continue;
    await page.goto(url);
    break;
  }
  run.stdout.resume();
  await page.waitForFunction(() => Number.isFinite(window.seerob?.t), null, { timeout: 120_000 });
});

after(async () => {
  await browser?.close();
  if (run && run.exitCode === null) await stopped();
  if (folder) fs.rmSync(folder, { recursive: true, force: true });
});

async function stopped() {
  const over = new Promise((resolve) => run.once("exit", resolve));
  run.kill("SIGINT");
  await over;
}

const at = (name) => page.evaluate((n) => window.seerob.pose(n)?.position ?? null, name);
const trigger = (value) =>
  page.evaluate((v) => window.headset.controllers.right.updateButtonValue("trigger", v), value);
const events = () => page.locator(".events li").allTextContents();

/** The point of the visitor's room at a point of the world (y up). */
const inRoom = (point) => page.evaluate((p) => window.seerob.inRoom(p), point);

/** The right hand there; a palm's length short of what it is to take. */
async function reach(point, short = 0.1) {
  const [x, y, z] = await inRoom(point);
  await put(page, [0, 1.64, 0], [x, y + 0.02, z + short], [0, -0.1, -1]);
  await pictures(page, 5);
}

async function until(name, holds) {
  for (let k = 0; k < 120; k += 1) {
    const now = await at(name);
    if (holds(now)) return now;
    await pictures(page, 3);
  }
  throw new Error(`${name} is at ${await at(name)}`);
}

/** Once a body has come to rest: on a slow machine the run's time stands still, and a hand swings after it. */
async function still(name) {
  for (let k = 0, calm = 0, before = await at(name); k < 150; k += 1) {
    await pictures(page, 5);
    const now = await at(name);
    calm = Math.hypot(...now.map((v, i) => v - before[i])) < 3e-3 ? calm + 1 : 0;
    before = now;
    if (calm === 3) return;
  }
  throw new Error(`${name} does not come to rest`);
}

test("a workpiece is taken, carried, put into a box; a lever is pulled", { timeout: 300_000 }, async () => {
  await page.getByRole("tab", { name: "Room" }).click({ timeout: 120_000 });
  await page.getByRole("button", { name: "be operator in VR", exact: true }).click({ timeout: 120_000 });
  await put(page, [0, 1.64, 0], [0.25, 1.1, -0.3]);
  await pictures(page, 20);
  const begin = await at("blank/body");
  await reach(begin);
  await trigger(1);
  await page.locator(".events li", { hasText: "blank taken" }).waitFor({ timeout: 60_000 });
  const [x, y, z] = begin;
  await reach([x, y + 0.12, z]);
  await until("blank/body", (p) => p[1] > begin[1] + 0.05);
  await still("blank/body");
  // The world of three.js has z of the cell as y, and y of the cell as -z.
  for (let k = 1; k <= 8; k += 1) await reach([x, y + 0.12, z - 0.05 * k]);
  // Down to the table, and still.
  await reach([x, y + 0.04, z - 0.4]);
  await still("blank/body");
  await trigger(0);
  await page.locator(".events li", { hasText: "round ended" }).waitFor({ timeout: 60_000 });
  const lines = await events();
  assert.match(lines.at(-3), /blank taken/);
  assert.match(lines.at(-2), /blank placed in box after/);
  assert.match(lines.at(-1), /round ended in box: [\d.]+ s/);
  const lies = await at("blank/body");
  assert.ok(Math.abs(lies[1] - 0.825) < 0.04, `it lies on the table: ${lies}`);

  const turned = () => page.evaluate(() => window.seerob.pose("valve/body").quaternion);
  const before = await turned();
  await reach(await at("valve/body"), 0.05);
  await trigger(1);
  const [a, b, c] = await at("valve/body");
  await reach([a, b + 0.3, c], 0.05);
  await trigger(0);
  for (let k = 0; k < 60 && 2 * Math.acos(Math.abs(dot(before, await turned()))) < 0.6; k += 1)
    await pictures(page, 3);
  assert.ok(2 * Math.acos(Math.abs(dot(before, await turned()))) > 0.6, "the valve follows its lever");
  assert.deepEqual([browser.complaints, browser.outside], [[], []]);
});

const dot = (p, q) =>
  Math.min(
    1,
    p.reduce((sum, v, i) => sum + v * q[i], 0),
  );

test("what cannot be makes that person undecided, without a speed that nobody had", async () => {
  const operator = page.locator("tr", { hasText: "operator – table" });
  // What is emulated lies over the page.
  await page.evaluate(() => document.getElementById("tab-criteria").click());
  for (const head of [
    [5, 1.64, 0],
    [Number.NaN, 1.64, 0],
    [1e9, 1.64, 0],
  ]) {
    await operator
      .getByText(/exceeded|within/)
      .first()
      .waitFor({ timeout: 60_000 });
    await put(page, head, [head[0] + 0.25, 1.1, -0.3]);
    await pictures(page, 6);
    await operator.getByText("undecided").first().waitFor({ timeout: 60_000 });
    await put(page, [0, 1.64, 0], [0.25, 1.1, -0.3]);
    await pictures(page, 20);
  }
  assert.deepEqual([browser.complaints, browser.outside], [[], []]);
});

test("the run again gives the same verdicts, poses and events bit for bit", {
  timeout: 300_000,
}, async () => {
  await page.evaluate(() => window.headset.activeSession?.end());
  await stopped();
  const file = fs.readdirSync(path.join(folder, "out"), { recursive: true }).find((f) => f.endsWith(".mcap"));
  const {
    fastest,
    ticks,
    same,
    grabs,
    events: happened,
  } = await askPython(AGAIN, JSON.stringify(path.join(folder, "out", file)));
  assert.ok(ticks > 100);
  assert.deepEqual(grabs.slice(0, 2), ["blank", ""]);
  assert.deepEqual(happened.slice(0, 3), ["taken", "placed", "round"]);
  // A step aside by the test itself is some metres per second; five metres between two pictures are hundreds.
  assert.ok(fastest < 12, `where the person is relied on, the head goes at ${fastest} m/s`);
  assert.ok(same, "verdicts, poses and events are the same");
});
