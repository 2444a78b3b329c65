// A visitor in AR over a cell in which something is real: the panel leads through touches, and then the twin lies
// where the cell is, and verdicts rest on where the visitor is.

import assert from "node:assert/strict";
import fs from "node:fs";
import os from "node:os";
import path from "node:path";
import { createInterface } from "node:readline";
import { after, before, test } from "node:test";
import { openBrowser } from "./browser.mjs";
import { enterRoom, HEADSET, pictures, put } from "./emulated_headset.mjs";
import { askPython, python } from "./python.mjs";

/** How far the twin may be from the cell at the table, after touches that are good to a millimetre [m]. */
const FITS = 5e-3;
const CORNERS = {
  a: [0, 0, 0.75],
  b: [0.6, 0, 0.75],
  c: [0, 1.2, 0.75],
  d: [0.6, 1.2, 1.35],
  e: [0.3, 0.6, 1.35],
};
const CELL = `
title = "A visitor in a real cell"
[[parts]]
name = "table"
real = true
shape = { box = [0.6, 1.2, 0.75] }
at = { position = [0.3, 0.6, 0.375] }
[[humans]]
name = "operator"
stature = 1.75
mass = 75
sex = "male"
unseen_uncertainty_mm = 100
at = { position = [1.5, 0.6, 0], rpy_deg = [0, 0, 180] }
[[sources]]
kind = "headset"
human = "operator"
timeout = 2
hold = 2
at = { position = [1.5, 0.6, 0], rpy_deg = [0, 0, 180] }
registration = { level = 0 }
${Object.entries(CORNERS)
  .map(([name, at]) => `[[landmarks]]\nname = "${name}"\nat = { position = [${at}] }\naccuracy_mm = 0.5\n`)
  .join("")}
[[landmarks]]
name = "sheet"
at = { position = [0.05, 0.3, 0.751], rpy_deg = [180, 0, 90] }
accuracy_mm = 0.2
board = "charuco 8x6 80 60"
[[safety]]
kind = "minimum_distance"
name = "operator – table"
limit = 0.05
between = ["operator", "table"]
`;
/** Where the room truly lies: turned by this about the vertical, and its floor there [m]; not quite as the file says. */
const YAW = Math.PI + 0.15;
const ORIGIN = [1.42, 0.7, 0];
const TIP = [0.005, -0.01, -0.08];

/** Size of what the device's camera sees [px]. */
const SEEN = { width: 1000, height: 750 };
/** A device that has a camera from when it is given one, as WebXR Raw Camera Access has it; it sees `window.seen`. */
const CAMERA = `
window.giveCamera = () => {
  window.headset.supportedFeatures.push("camera-access");
  let texture = null;
  Object.defineProperty(XRView.prototype, "camera", {
    get: () => ({ width: ${SEEN.width}, height: ${SEEN.height} }),
  });
  window.XRWebGLBinding = class {
    constructor(session, gl) {
      this.gl = gl;
    }
    getCameraImage() {
      const { gl } = this;
      texture ??= gl.createTexture();
      const before = gl.getParameter(gl.TEXTURE_BINDING_2D);
      gl.bindTexture(gl.TEXTURE_2D, texture);
      gl.pixelStorei(gl.UNPACK_FLIP_Y_WEBGL, false);
      gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, ${SEEN.width}, ${SEEN.height}, 0, gl.RGBA, gl.UNSIGNED_BYTE, window.seen ?? null);
      gl.bindTexture(gl.TEXTURE_2D, before);
      return texture;
    }
  };
};`;
/** What a camera sees of the board that lies in the cell; in: its lens, and where it is in the cell. */
const RENDER = `
import base64, json, sys
import cv2
import numpy as np
from seerob.core.transforms import inverse, rotation_from_wxyz, transform
from seerob.description.camera import board as boards
from seerob.description.camera.board import made
from seerob.description.capture.registration import turn
asked = json.load(sys.stdin)
board, dots = boards.read("charuco 8x6 80 60"), 1500
size = round(8 * 0.08 * dots), round(6 * 0.08 * dots)
print_ = cv2.copyMakeBorder(made(board).generateImage(size), 60, 60, 60, 60, cv2.BORDER_CONSTANT, value=255)
x = turn(np.array([np.pi, 0, 0]))
z = turn(np.array([0, 0, np.pi / 2]))
cell_from_board = transform(z @ x, [0.05, 0.3, 0.751])
fx, fy, cx, cy = asked["lens"]
u, v = np.meshgrid(np.arange(asked["width"], dtype=float), np.arange(asked["height"], dtype=float))
rays = np.stack([(u - cx) / fx, (v - cy) / fy, np.ones_like(u)], -1)
out = []
for matrix in asked["cameras"]:
    T = inverse(np.reshape(matrix, (4, 4))) @ cell_from_board
    H = np.linalg.inv(np.column_stack([T[:3, 0], T[:3, 1], T[:3, 3]]))
    on = rays @ H.T
    xy = (on[..., :2] / on[..., 2:] * dots + 60 - 0.5).astype(np.float32)
    seen = cv2.remap(print_, xy[..., 0], xy[..., 1], cv2.INTER_AREA, borderValue=140)
    seen = cv2.GaussianBlur(seen, (0, 0), 0.6)
    rgba = np.full((*seen.shape, 4), 255, np.uint8)
    rgba[..., :3] = seen[::-1, :, None]
    out.append(base64.b64encode(rgba.tobytes()).decode())
print(json.dumps(out))
`;

let folder;
let run;
let browser;
let page;

before(async () => {
  folder = fs.mkdtempSync(path.join(os.tmpdir(), "seerob-register-"));
  fs.writeFileSync(path.join(folder, "workstation.toml"), CELL);
  run = python("-m", "seerob", "run", folder, "--port", "0", "--no-record");
  browser = await openBrowser({ width: 640, height: 400 });
  page = browser.page;
  await page.addInitScript(HEADSET);
  await page.addInitScript(CAMERA);
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

/** A point of the cell in the room of WebXR: y up, -z ahead. */
function inRoom([x, y, z]) {
  const [u, v] = [x - ORIGIN[0], y - ORIGIN[1]];
  const [ahead, left] = [Math.cos(YAW) * u + Math.sin(YAW) * v, -Math.sin(YAW) * u + Math.cos(YAW) * v];
  return [-left, z, -ahead];
}

const trigger = (value, hand = "right") =>
  page.evaluate(([v, h]) => window.headset.controllers[h].updateButtonValue("trigger", v), [value, hand]);
const stick = (y) => page.evaluate((v) => window.headset.controllers.right.updateAxes("thumbstick", 0, v), y);
const asked = (words, timeout = 60_000) =>
  page.waitForFunction((w) => window.seerob.asked.some((line) => line.includes(w)), words, { timeout });

/** Turn the right controller about its tip at a point of the room, one lean per picture. */
function sweep(tip, at, leans) {
  return page.evaluate(
    async ([t, p, each]) => {
      const { headset } = window;
      const { right } = headset.controllers;
      const picture = () => new Promise((done) => headset.activeSession.requestAnimationFrame(done));
      for (const [x, z] of each) {
        const w = Math.sqrt(1 - x * x - z * z);
        // p − R t for the quaternion (x, 0, z, w).
        const cross = (a, b) => [
          a[1] * b[2] - a[2] * b[1],
          a[2] * b[0] - a[0] * b[2],
          a[0] * b[1] - a[1] * b[0],
        ];
        const q = [x, 0, z];
        const c = cross(q, t).map((v) => 2 * v);
        const d = cross(q, c);
        window.put(
          2,
          p.map((v, i) => v - (t[i] + w * c[i] + d[i])),
        );
        right.quaternion.set(x, 0, z, w);
        right.position.set(...p.map((v, i) => v - (t[i] + w * c[i] + d[i])));
        await picture();
        await picture();
      }
    },
    [tip, at, leans],
  );
}

test("touches put the twin where the cell is, and what was undecided is decided", {
  timeout: 900_000,
}, async () => {
  await enterRoom(page, "be operator in AR");
  await put(page, [0, 1.64, 0], [0.25, 1.1, -0.3]);
  await asked("Where is the tip");
  await page.waitForFunction(() => window.headset.activeSession.inputSources.length === 2);
  // The emulator calls every place of a controller a guess.
  await page.evaluate(() => {
    const [, right] = window.headset.activeSession.inputSources;
    right.gripSpace[IWER.P_SPACE].emulated = false;
  });
  await page.waitForFunction(
    () => window.seerob.panels.some((line) => line.includes("nobody found out where the room")),
    null,
    { timeout: 240_000 },
  );
  // Other ways than touches, and what the server says of one for which the file has no figures.
  for (const words of ["Strap it to what carries a", "Lay it at a,"]) {
    await stick(1);
    await asked(words);
    await stick(0);
    await pictures(page, 2);
  }
  await trigger(1, "left");
  await asked("nobody says how well the device sees it");
  await trigger(0, "left");
  await stick(1);
  await asked("No picture of this device’s camera");
  await stick(0);
  await pictures(page, 2);
  await stick(1);
  await asked("Where is the tip");
  await stick(0);
  const leans = Array.from({ length: 30 }, (_, k) => [
    0.3 * Math.cos(k / 2) * ((k + 4) / 34),
    0.3 * Math.sin(k / 2) * ((k + 4) / 34),
  ]);
  await sweep(TIP, [0.2, 1.0, -0.4], leans.slice(0, 1));
  await trigger(1);
  await sweep(TIP, [0.2, 1.0, -0.4], leans);
  await trigger(0);
  for (const [name, at] of Object.entries(CORNERS)) {
    await asked(`Touch ${name} `);
    await sweep(TIP, inRoom(at), [[0.1, 0.05]]);
    await trigger(1);
    await pictures(page, 8);
    await trigger(0);
  }
  await page.waitForFunction(() => window.seerob.asked.some((line) => line.startsWith("5 touched")), null, {
    timeout: 240_000,
  });
  const lines = await page.evaluate(() => window.seerob.asked);
  const [, off] = lines.join(" ").match(/off by ([0-9.]+) mm/) ?? [];
  assert.ok(Number(off) < 10, lines.join("; "));
  await pictures(page, 3);
  for (const at of [CORNERS.b, [0.3, 0.6, 0.75]]) {
    const [x, y, z] = await page.evaluate((p) => window.seerob.visited(p), inRoom(at));
    const far = Math.hypot(x - at[0], -z - at[1], y - at[2]);
    assert.ok(far < FITS, `${far} m off`);
  }
  assert.equal(await page.evaluate(() => window.seerob.occludes("table")), true);
  await page.waitForFunction(
    () => !window.seerob.panels.some((line) => line.includes("nobody found out where the room")),
    null,
    { timeout: 240_000 },
  );
  // The board is there, and says of each criterion what it comes to.
  const board = await page.evaluate(() => window.seerob.panels);
  assert.match(board[0], /run:/);
  assert.deepEqual([browser.complaints, browser.outside], [[], []]);
});

test("looks of the device's own camera at a printed board put the twin where the cell is", {
  timeout: 400_000,
}, async () => {
  await page.evaluate(() => {
    window.giveCamera();
    return window.headset.activeSession?.end();
  });
  await enterRoom(page, "be operator in AR");
  await asked("Look at the board at sheet");
  // From three places, ahead of the board's middle and down at it: a turn of the head about x [rad].
  const places = [
    [0, 0],
    [-0.2, 0.1],
    [0.2, -0.1],
  ].map(([aside, back]) => {
    const [x, , z] = inRoom([0.05 + 0.24, 0.3 + 0.32, 0.75]);
    return [x + aside, 1.5, z + 0.45 + back];
  });
  const turned = [-Math.sin(0.5), 0, 0, Math.cos(0.5)];
  const views = [];
  for (const at of places) {
    await page.evaluate(
      ([p, q]) => {
        window.put(0, p);
        window.headset.quaternion.set(...q);
      },
      [at, turned],
    );
    await pictures(page, 3);
    views.push(
      await page.evaluate(async () => {
        const session = window.headset.activeSession;
        const floor = await session.requestReferenceSpace("local-floor");
        return new Promise((done) => {
          session.requestAnimationFrame((_, frame) => {
            const [view] = frame.getViewerPose(floor).views;
            done({ matrix: [...view.transform.matrix], projection: [...view.projectionMatrix] });
          });
        });
      }),
    );
  }
  const { width, height } = SEEN;
  const [p] = views.map(({ projection }) => projection);
  const lens = [
    (p[0] * width) / 2,
    (p[5] * height) / 2,
    ((1 - p[8]) * width) / 2 - 0.5,
    ((1 + p[9]) * height) / 2 - 0.5,
  ];
  // Where each camera is in the cell, x to the right, y down, z ahead, row by row.
  const point = (m, v, w) =>
    [0, 1, 2].map((i) => m[i] * v[0] + m[4 + i] * v[1] + m[8 + i] * v[2] + w * m[12 + i]);
  const inCell = ([x, y, z], w) => {
    const [ahead, left] = [-z, -x];
    const [c, s] = [Math.cos(YAW), Math.sin(YAW)];
    return [c * ahead - s * left + w * ORIGIN[0], s * ahead + c * left + w * ORIGIN[1], y];
  };
  const cameras = views.map(({ matrix }) => {
    const columns = [
      inCell(point(matrix, [1, 0, 0], 0), 0),
      inCell(point(matrix, [0, -1, 0], 0), 0),
      inCell(point(matrix, [0, 0, -1], 0), 0),
      inCell(point(matrix, [0, 0, 0], 1), 1),
    ];
    return [...[0, 1, 2].flatMap((i) => columns.map((column) => column[i])), 0, 0, 0, 1];
  });
  const rendered = await askPython(RENDER, JSON.stringify({ lens, cameras, width, height }));
  for (const [k, at] of places.entries()) {
    await page.evaluate(
      ([q, text]) => {
        window.put(0, q);
        window.seen = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
      },
      [at, rendered[k]],
    );
    await pictures(page, 3);
    await trigger(1);
    await pictures(page, 3);
    await trigger(0);
    await page.waitForFunction(
      (n) => window.seerob.asked.some((line) => line.startsWith(`${n} looks`)),
      k + 1,
      { timeout: 60_000 },
    );
  }
  await page.waitForFunction(() => window.seerob.asked.some((line) => line.startsWith("off by")));
  await pictures(page, 3);
  for (const at of [CORNERS.b, [0.3, 0.6, 0.75]]) {
    const [x, y, z] = await page.evaluate((q) => window.seerob.visited(q), inRoom(at));
    const far = Math.hypot(x - at[0], -z - at[1], y - at[2]);
    assert.ok(far < FITS, `${far} m off`);
  }
  assert.deepEqual([browser.complaints, browser.outside], [[], []]);
});
