// A clip of the room is read by OpenCV: its pictures, when they are shown, and what is on them.

import assert from "node:assert/strict";
import fs from "node:fs";
import os from "node:os";
import path from "node:path";
import { after, before, test } from "node:test";
import { open, settled } from "./expect.mjs";
import { askPython } from "./python.mjs";

// What is on the last picture beside the picture that the page saved of it, and when each is shown.
const READ = `
import json, sys
import cv2
import numpy as np
clip, picture, found, sought = json.load(sys.stdin)
video = cv2.VideoCapture(clip, cv2.CAP_FFMPEG)
count, size = video.get(cv2.CAP_PROP_FRAME_COUNT), [video.get(cv2.CAP_PROP_FRAME_WIDTH), video.get(cv2.CAP_PROP_FRAME_HEIGHT)]
shown, frames = [], []
while True:
    good, frame = video.read()
    if not good:
        break
    shown.append(video.get(cv2.CAP_PROP_POS_MSEC))
    frames.append(frame)
# Edges lie half a pixel elsewhere where a clip is a pixel narrower than the room.
coarse = lambda a: cv2.resize(a, (40, 40), interpolation=cv2.INTER_AREA).astype(float)
far = lambda a, b: float(np.abs(coarse(a) - coarse(b)).mean())
png = cv2.imread(picture)
# What a player that went there shows is the picture of that time, or one beside it: how long a picture lasts
# is not in the file, and players guess. Of pictures that are alike each is as good.
due = max(k for k, ms in enumerate(shown) if ms <= sought)
there = cv2.imread(found)
off = [far(frame, there) for frame in frames]
print(json.dumps(dict(due=min(off[max(due - 1, 0) : due + 2]), least=min(off), count=count, size=size, shown=shown, same=far(frames[-1], png), moved=far(frames[0], frames[-1]))))
`;
const folder = fs.mkdtempSync(path.join(os.tmpdir(), "seerob-clip-"));
let opened;
let page;

before(async () => {
  opened = await open(["--mode", "replay", "--seconds", "6"], { width: 900, height: 600 });
  page = opened.page;
  page.setDefaultTimeout(60_000);
});

after(async () => {
  await opened?.close();
  fs.rmSync(folder, { recursive: true });
});

async function taken(name, file) {
  const [download] = await Promise.all([
    page.waitForEvent("download", { timeout: 240_000 }),
    page.getByRole("button", { name, exact: true }).click(),
  ]);
  const to = path.join(folder, file);
  await download.saveAs(to);
  return { to, called: download.suggestedFilename() };
}

/** What a video element shows that goes to a share of a clip's length, and when that is. */
async function playedAt(clip, share, to) {
  const player = await opened.browser.context.newPage();
  const [ms, png] = await player.evaluate(
    async ([data, part]) => {
      const video = document.createElement("video");
      const happens = (what) =>
        new Promise((resolve, reject) => {
          video.addEventListener(what, resolve, { once: true });
          video.addEventListener("error", () => reject(new Error(video.error.message)), { once: true });
        });
      const ready = happens("loadeddata");
      video.src = URL.createObjectURL(await (await fetch(`data:video/webm;base64,${data}`)).blob());
      await ready;
      const at = part * video.duration;
      // What was sought may be there before it is shown.
      document.body.append(video);
      const shown = new Promise((resolve) => {
        const look = (_, { mediaTime }) =>
          mediaTime > 0 ? resolve() : video.requestVideoFrameCallback(look);
        video.requestVideoFrameCallback(look);
      });
      const there = happens("seeked");
      video.currentTime = at;
      await Promise.all([there, shown]);
      const canvas = document.createElement("canvas");
      [canvas.width, canvas.height] = [video.videoWidth, video.videoHeight];
      canvas.getContext("2d").drawImage(video, 0, 0);
      return [1000 * at, canvas.toDataURL("image/png").split(",")[1]];
    },
    [fs.readFileSync(clip).toString("base64"), share],
  );
  await player.close();
  fs.writeFileSync(to, Buffer.from(png, "base64"));
  return { to, ms };
}

test("a clip has every picture that was drawn, in its time, ends with what is shown, and is gone to by a player", async () => {
  await settled(page);
  const view = page.getByRole("button", { name: "View", exact: true });
  await view.click();
  const begun = Date.now();
  await page.getByRole("button", { name: "Clip", exact: true }).click();
  await page.getByRole("button", { name: "End the clip" }).waitFor();
  // A panel that is closed meanwhile ends nothing.
  await view.click();
  const from = await page.evaluate(() => window.seerob.t);
  await page.keyboard.press("Space");
  await page.waitForFunction((t) => window.seerob.t > t + 1.5, from, { timeout: 240_000 });
  await page.keyboard.press("Space");
  await settled(page);
  await view.click();
  const clip = await taken("End the clip", "clip.webm");
  const lasted = Date.now() - begun;
  const picture = await taken("Picture", "picture.png");
  assert.match(clip.called, /\.webm$/);
  const sought = await playedAt(clip.to, 0.6, path.join(folder, "sought.png"));
  const read = await askPython(READ, JSON.stringify([clip.to, picture.to, sought.to, sought.ms]));
  assert.ok(read.shown.length >= 5, `${read.shown}`);
  assert.ok(read.count > 0, `${read.count}`); // as the file says how long it is
  assert.ok(
    read.shown.every((ms, k) => k === 0 || ms > read.shown[k - 1]),
    `${read.shown}`,
  );
  assert.equal(read.shown[0], 0);
  assert.ok(read.due < read.least + 0.5, JSON.stringify(read));
  assert.ok(
    read.shown.at(-1) > 1000 && read.shown.at(-1) <= lasted + 100,
    `${read.shown.at(-1)} of ${lasted}`,
  );
  // Colours are coded coarsely; the arm has moved by far more than that.
  assert.ok(read.same < read.moved / 3, JSON.stringify(read));
  assert.deepEqual(opened.browser.complaints, []);
});
