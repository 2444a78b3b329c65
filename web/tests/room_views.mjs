// Pictures of what one sees in the room: `node tests/room_views.mjs` writes docs/pictures/room anew, which docs/xr.md
// shows; `node tests/room_views.mjs camera` that one only. `motor_station` and `assembly_line` are the twin over the
// emulated picture of those cells, beside their files.

import fs from "node:fs";
import os from "node:os";
import path from "node:path";
import { createInterface } from "node:readline";
import { fileURLToPath } from "node:url";
import { openBrowser } from "./browser.mjs";
import { enterRoom, HEADSET, outOfRoom, pictures, pressInRoom, put, trigger } from "./emulated_headset.mjs";
import { python } from "./python.mjs";

const HERE = path.dirname(fileURLToPath(import.meta.url));
const ROOT = path.resolve(HERE, "../..");
const TO = path.join(ROOT, "docs/pictures/room");
const SIZE = { width: 1120, height: 700 };
const EYES = [0, 1.64, 0];
const only = process.argv.slice(2);
const wanted = (name) => only.length === 0 || only.includes(name);
const folder = fs.mkdtempSync(path.join(os.tmpdir(), "seerob-room-views-"));
fs.mkdirSync(TO, { recursive: true });

/** A live run and its address. */
async function running(...more) {
  const run = python("-m", "seerob", "run", ...more, "--port", "0", "--no-record");
  for await (const line of createInterface({ input: run.stdout })) {
    const [, url] = line.match(/^page\s+(\S+)/) ?? [];
    if (!url) continue;
    run.stdout.resume();
    const close = () => {
      const over = new Promise((resolve) => run.once("exit", resolve));
      run.kill("SIGINT");
      return over;
    };
    return { url, close };
  }
  throw new Error("the run has no page");
}

async function show(browser, url) {
  await browser.page.goto(url);
  await browser.page.waitForFunction(() => Number.isFinite(window.seerob?.t));
}

/** Enter, look down by an angle [rad], with the left hand so high [m]. */
const enter = async (page, name, down = 0.25, left = 1.15) => {
  await enterRoom(page, name);
  await page.getByRole("status").getByText("headset on").waitFor();
  await page.evaluate(
    ([angle, height]) => {
      window.put(1, [-0.2, height, -0.5]);
      window.headset.quaternion.set(-Math.sin(angle / 2), 0, 0, Math.cos(angle / 2));
    },
    [down, left],
  );
  await put(page, EYES, [0.3, 1.15, -0.4], [-0.1, -0.25, -1]);
  // The person has come to where the visitor is.
  await page.waitForFunction(() => Object.values(window.seerob.drawn).includes("within"));
  await pictures(page, 20);
};
const leave = async (page) => {
  await page.evaluate(() => window.headset.activeSession.end());
  await outOfRoom(page);
};

/** Keep the picture of the room alone, as WebP, by the browser that draws it. */
async function keep({ page, context }, name) {
  // The emulator takes the canvas out of the page and lays it over the middle of it.
  const clip = await page.evaluate(() => {
    const boxes = [...document.querySelectorAll("canvas")].map((each) => each.getBoundingClientRect());
    const [box] = boxes.sort((a, b) => b.width * b.height - a.width * a.height);
    return { x: box.x, y: box.y, width: box.width, height: box.height };
  });
  const png = await page.screenshot({ clip });
  const tool = await context.newPage();
  const data = await tool.evaluate(async (text) => {
    const picture = await createImageBitmap(await (await fetch(`data:image/png;base64,${text}`)).blob());
    const canvas = document.createElement("canvas");
    [canvas.width, canvas.height] = [picture.width, picture.height];
    canvas.getContext("2d").drawImage(picture, 0, 0);
    return canvas.toDataURL("image/webp", 0.78).split(",")[1];
  }, png.toString("base64"));
  await tool.close();
  fs.writeFileSync(path.resolve(TO, `${name}.webp`), Buffer.from(data, "base64"));
  process.stdout.write(`${name}.webp\n`);
}

/** The twin of the demo: in it, over a real table, with hands that design, and with somebody else in it. */
async function inTheRoom() {
  const cell = path.join(folder, "cell");
  fs.cpSync(path.join(ROOT, "web/demo/cell"), cell, { recursive: true });
  const file = path.join(cell, "workstation.toml");
  // How well the headset's place was measured is known: else nothing is decided beside what is real.
  const real = fs
    .readFileSync(file, "utf8")
    .replace('name = "table"\n', 'name = "table"\nreal = true\n')
    .replace('kind = "headset"\n', 'kind = "headset"\nregistration = { at = 0.005, at_turn = 0.005 }\n');
  fs.writeFileSync(file, real);
  const [run, browser] = await Promise.all([running(cell, "--edit"), openBrowser(SIZE)]);
  const { page } = browser;
  await page.emulateMedia({ colorScheme: "dark" });
  await page.addInitScript(HEADSET);
  await show(browser, run.url);
  if (wanted("vr")) {
    await enter(page, "be operator in VR");
    await keep(browser, "vr");
    await leave(page);
  }
  if (wanted("panels")) {
    await enter(page, "be operator in VR", -0.2, 1.0);
    await pressInRoom(page, "body map", EYES);
    await put(page, EYES, [0.3, 1.0, -0.4], [-0.1, -0.25, -1]);
    // The arm has gone back from the menu.
    await page.waitForTimeout(3000);
    await keep(browser, "panels");
    await leave(page);
  }
  if (wanted("ar")) {
    await enter(page, "be operator in AR", 0.25);
    // There is no room behind: a plain colour stands for it.
    await page.evaluate(() => {
      const size = ({ width, height }) => width * height;
      const [drawn] = [...document.querySelectorAll("canvas")].sort((a, b) => size(b) - size(a));
      document.documentElement.style.background = document.body.style.background = "#59616e";
      for (const each of document.body.querySelectorAll("*"))
        each.style.visibility = each === drawn ? "visible" : "hidden";
    });
    await pictures(page, 4);
    await keep(browser, "ar");
    await page.evaluate(() => {
      for (const each of document.querySelectorAll("*")) each.style.visibility = each.style.background = "";
    });
    await leave(page);
  }
  if (wanted("design")) {
    await enter(page, "be operator in VR");
    await pressInRoom(page, "design", EYES);
    const there = await page.evaluate(() => window.seerob.inRoom(window.seerob.pose("box_bottom").position));
    const from = [0.3, 1.25, -0.3];
    await put(
      page,
      EYES,
      from,
      there.map((v, i) => v - from[i]),
    );
    await pictures(page, 4);
    await trigger(page, 1);
    await put(
      page,
      EYES,
      [0.1, 1.35, -0.35],
      there.map((v, i) => v - from[i]),
    );
    await pictures(page, 8);
    await keep(browser, "design");
    await trigger(page, 0);
    await leave(page);
  }
  if (wanted("visitors")) {
    await page.keyboard.press("Escape");
    const other = await openBrowser(SIZE);
    await other.page.addInitScript(HEADSET);
    await show(other, run.url);
    await enter(other.page, "be operator in VR");
    await page.getByText("more here").first().waitFor();
    await pictures(other.page, 6);
    await page.waitForTimeout(2000);
    await keep(browser, "visitors");
    await other.close();
  }
  await browser.close();
  await run.close();
}

/** The twin of balls over the picture of a webcam. */
async function overAPicture() {
  const made = python(path.join(HERE, "seen_cell.py"), folder, "http://127.0.0.1:9/none");
  made.stdout.resume();
  await new Promise((resolve) => made.once("exit", resolve));
  const flags = [
    "--use-fake-ui-for-media-stream",
    "--use-fake-device-for-media-stream",
    `--use-file-for-fake-video-capture=${path.join(folder, "seen.y4m")}`,
  ];
  const [run, browser] = await Promise.all([running(folder), openBrowser({ ...SIZE, flags })]);
  await show(browser, run.url);
  await browser.page.getByRole("button", { name: "webcam", exact: true }).click();
  await browser.page.locator(".camera-note").getByText("webcam", { exact: true }).waitFor();
  await browser.page.waitForTimeout(2000);
  await keep(browser, "camera");
  await browser.close();
  await run.close();
}

/** A cell of the paper over the picture of its camera, once the person is heard and works. */
async function cellOverItsPicture(cell, camera) {
  const at = path.join(ROOT, "workstations", cell);
  const [run, browser] = await Promise.all([
    running(at, "--emulated"),
    openBrowser({ width: 1600, height: 900 }),
  ]);
  await show(browser, run.url);
  await browser.page.getByRole("button", { name: camera, exact: true }).click();
  await browser.page.locator(".camera-note").getByText("95 % of its error").waitFor();
  // The person has been calibrated, and reaches forward in every round of the machine's clock.
  await browser.page.waitForFunction(() => {
    const [note] = document.querySelectorAll(".camera-note");
    const phase = (Date.now() / 1000) % 12;
    const drawn = note?.textContent.includes("95 % of its error");
    return window.seerob.t > 26 && phase > 3.5 && phase < 8 && drawn;
  });
  await keep(browser, path.join(at, "camera"));
  await browser.close();
  await run.close();
}

const CELLS = { motor_station: "bench_side", assembly_line: "line_side" };
for (const [cell, camera] of Object.entries(CELLS)) if (wanted(cell)) await cellOverItsPicture(cell, camera);
if (["vr", "panels", "ar", "design", "visitors"].some(wanted)) await inTheRoom();
if (wanted("camera")) await overAPicture();
fs.rmSync(folder, { recursive: true });
