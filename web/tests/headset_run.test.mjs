// A visitor who is a person of a real run: what the emulated headset does, the person in the physics does.

import assert from "node:assert/strict";
import fs from "node:fs";
import os from "node:os";
import path from "node:path";
import { createInterface } from "node:readline";
import { after, before, test } from "node:test";
import { openBrowser } from "./browser.mjs";
import { enterRoom, HEADSET, pictures, pressInRoom, put, trigger } from "./emulated_headset.mjs";
import { python } from "./python.mjs";

/** How far the person may be from what the headset did [m]. */
const FOLLOWS = 0.01;
const CELL = `
title = "A visitor at a table"
[[parts]]
name = "table"
shape = { box = [0.6, 1.2, 0.75] }
at = { position = [0, 0, 0.375] }
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
[[safety]]
kind = "minimum_distance"
name = "operator – table"
limit = 0.05
between = ["operator", "table"]
[[safety]]
kind = "velocity"
name = "speed"
of = "operator/head"
limit = 3.0
`;

let folder;
let run;
let browser;
let page;

before(async () => {
  folder = fs.mkdtempSync(path.join(os.tmpdir(), "seerob-visit-"));
  fs.writeFileSync(path.join(folder, "workstation.toml"), CELL);
  run = python("-m", "seerob", "run", folder, "--port", "0", "--no-record");
  browser = await openBrowser({ width: 800, height: 500 });
  page = browser.page;
  await page.addInitScript(HEADSET);
  for await (const line of createInterface({ input: run.stdout })) {
    const [url] = line.match(/http:\/\/\S+/) ?? [];
    if (!url) continue;
    await page.goto(url);
    break;
  }
  run.stdout.resume();
  await page.waitForFunction(() => Number.isFinite(window.seerob?.t), null, { timeout: 240_000 });
});

after(async () => {
  await browser?.close();
  if (run && run.exitCode === null) {
    const over = new Promise((resolve) => run.once("exit", resolve));
    run.kill("SIGINT");
    await over;
  }
  if (folder) fs.rmSync(folder, { recursive: true, force: true });
});

const at = (name) => page.evaluate((n) => window.seerob.pose(n), name);
const minus = (a, b) => a.map((v, i) => v - b[i]);
const plus = (a, b) => a.map((v, i) => v + b[i]);
const length = (v) => Math.hypot(...v);
const cross = ([a, b, c], [x, y, z]) => [b * z - c * y, c * x - a * z, a * y - b * x];

/** A vector turned by a quaternion (x, y, z, w). */
function turn([x, y, z, w], v) {
  const t = cross([x, y, z], v).map((each) => 2 * each);
  return plus(
    plus(
      v,
      t.map((each) => w * each),
    ),
    cross([x, y, z], t),
  );
}

/** A point of the world as a body has it, and the other way round. */
const inBody = ({ position, quaternion: [x, y, z, w] }, p) => turn([-x, -y, -z, w], minus(p, position));
const inWorld = ({ position, quaternion }, p) => plus(position, turn(quaternion, p));

/** Where the right controller is held, in the room (y up) [m]: its beam begins centimetres ahead of that. */
const grip = () =>
  page.evaluate(async () => {
    const session = window.headset.activeSession;
    const space = await session.requestReferenceSpace("local-floor");
    const right = [...session.inputSources].find(({ handedness }) => handedness === "right");
    return new Promise((done) => {
      session.requestAnimationFrame((_, frame) => {
        const { x, y, z } = frame.getPose(right.gripSpace, space).transform.position;
        done([x, y, z]);
      });
    });
  });

/** Where bones are once they have stood still for 0.3 s of the run. */
async function stand(names) {
  let since = null;
  for (let k = 0; k < 1000; k += 1) {
    await pictures(page, 4);
    const [t, now] = [await page.evaluate(() => window.seerob.t), await Promise.all(names.map(at))];
    const still = since?.poses.every((p, i) => length(minus(now[i].position, p.position)) < 5e-4);
    if (!still) since = { t, poses: now };
    else if (t - since.t >= 0.3) return now;
  }
  throw new Error("the person does not come to rest");
}

test("head and hand of the person go where those of the visitor go", { timeout: 900_000 }, async () => {
  await enterRoom(page, "be operator in VR");
  await put(page, [0, 1.64, 0], [0.25, 1.1, -0.3]);
  const bones = ["operator/head", "operator/right_hand"];
  const [head, hand] = await stand(bones);
  const visited = (point) => page.evaluate((p) => window.seerob.visited(p), point);
  const eyes = await visited([0, 1.64, 0]);
  assert.ok(
    length(minus(head.position, eyes)) < 0.25,
    `the head is at ${head.position}, the eyes at ${eyes}`,
  );
  // A step aside, and the hand further ahead and down besides: what is at the eyes and in the hand goes along.
  const held = [inBody(head, eyes), inBody(hand, await visited(await grip()))];
  await put(page, [0.12, 1.6, -0.05], [0.4, 1.0, -0.4]);
  const later = await stand(bones);
  const expected = [await visited([0.12, 1.6, -0.05]), await visited(await grip())];
  for (const [k, bone] of bones.entries()) {
    const off = length(minus(inWorld(later[k], held[k]), expected[k]));
    assert.ok(off < FOLLOWS, `${bone}: ${off} m off`);
  }
  assert.deepEqual([browser.complaints, browser.outside], [[], []]);
});

test("who is 5 m elsewhere from one picture to the next is UNDECIDED, and nobody is fast", {
  timeout: 900_000,
}, async () => {
  const names = ["operator – table", "speed"];
  await put(page, [0, 1.56, 0], [0.25, 1.02, -0.3]);
  await page.evaluate(() => window.put(1, [-0.25, 1.02, -0.3]));
  const [before] = await stand(["operator/head"]);
  // What is drawn in each picture, seen at its end.
  await page.evaluate(() => {
    window.seen = [];
    const note = () => {
      const { seerob, headset } = window;
      const { position } = seerob.pose("operator/head");
      window.seen.push({ position, drawn: { ...seerob.drawn } });
      headset.activeSession.requestAnimationFrame(note);
    };
    window.headset.activeSession.requestAnimationFrame(note);
  });
  const visited = (point) => page.evaluate((p) => window.seerob.visited(p), point);
  const leap = minus(await visited([5, 0, 0]), await visited([0, 0, 0]));
  assert.ok(Math.abs(length(leap) - 5) < 1e-3);
  await page.evaluate(() => {
    const { headset } = window;
    for (const [i, each] of [headset, headset.controllers.left, headset.controllers.right].entries()) {
      const [x, y, z] = each.position.vec3;
      window.put(i, [x + 5, y, z]);
    }
  });
  const after = plus(before.position, leap);
  await page.waitForFunction(
    (p) => Math.hypot(...p.map((v, i) => v - seerob.pose("operator/head").position[i])) < 0.25,
    after,
    { timeout: 120_000 },
  );
  // The table is behind then.
  await page.waitForFunction((each) => each.every((n) => window.seerob.drawn[n] === "within"), names, {
    timeout: 120_000,
  });
  const seen = await page.evaluate(() => window.seen);
  const away = ({ position }) =>
    Math.min(length(minus(position, before.position)), length(minus(position, after)));
  for (const one of seen) {
    const verdicts = names.map((name) => one.drawn[name]);
    assert.notEqual(one.drawn.speed, "exceeded", JSON.stringify(one));
    if (away(one) > 0.25) assert.deepEqual(verdicts, ["undecided", "undecided"], JSON.stringify(one));
  }
  assert.ok(seen.some(({ drawn }) => names.every((name) => drawn[name] === "undecided")));
  assert.deepEqual([browser.complaints, browser.outside], [[], []]);
});

test("the person is fitted to the visitor: floor, arms to the sides, stature", {
  timeout: 900_000,
}, async () => {
  const place = (i, at) => page.evaluate(([k, p]) => window.put(k, p), [i, at]);
  const asked = (words) =>
    page.waitForFunction((w) => window.seerob.asked.some((line) => line.includes(w)), words, {
      timeout: 240_000,
    });
  await put(page, [0, 1.6, 0], [0.25, 1.1, -0.3]);
  await pressInRoom(page, "fit me");
  await asked("Where is your floor");
  // The device has its floor 20 mm too high: what lies on it is lower, and so are the eyes.
  const [low, eyes, hands] = [-0.02, 0.936 * 1.75, 0.818 * 1.75];
  await place(1, [-0.2, low + 0.03, -0.4]);
  const lies = await page.evaluate(async () => {
    const session = window.headset.activeSession;
    const space = await session.requestReferenceSpace("local-floor");
    const [left] = [...session.inputSources].filter(({ handedness }) => handedness === "left");
    return new Promise((done) => {
      session.requestAnimationFrame((_, frame) =>
        done(frame.getPose(left.gripSpace, space).transform.position.y),
      );
    });
  });
  await pictures(page, 2);
  await trigger(page, 1);
  await trigger(page, 0);
  await asked("Arms to the sides");
  await place(0, [0, low + eyes, -0.0875]);
  await place(1, [-0.895, low + hands, 0]);
  await place(2, [0.895, low + hands, 0]);
  await asked("It fits");
  const lines = (await page.evaluate(() => window.seerob.asked)).join(" ");
  const [, share] = lines.match(/You are (\d+) % as tall as operator/);
  assert.ok(Math.abs(Number(share) - 100) <= 1, lines);
  // The floor goes along: the controller lies on it, 30 mm over it where it is held.
  const [, height] = await page.evaluate((p) => window.seerob.visited(p), [0, lies, 0]);
  assert.ok(Math.abs(height - 0.03) < 2e-3, `${height}`);
  assert.deepEqual([browser.complaints, browser.outside], [[], []]);
});
