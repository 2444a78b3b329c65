// The page over TLS, by the authority that seerob makes, in a real browser: who may look, and who may control.

import assert from "node:assert/strict";
import fs from "node:fs";
import os from "node:os";
import path from "node:path";
import { after, before, test } from "node:test";
import { encode } from "@msgpack/msgpack";
import { openBrowser } from "./browser.mjs";
import { show } from "./expect.mjs";
import { serve } from "./served.mjs";

const folder = fs.mkdtempSync(path.join(os.tmpdir(), "seerob-tls-"));
let served;
let browser;
let page;

before(async () => {
  served = await serve("--mode", "replay", "--tls", folder);
  browser = await openBrowser({ flags: [`--ignore-certificate-errors-spki-list=${served.pin}`] });
  page = browser.page;
});

after(async () => {
  await Promise.all([browser?.close(), served?.close()]);
  fs.rmSync(folder, { recursive: true });
});

/** What a WebSocket of the page hears that knows a token, or only the cookie: how it opened and ended. */
const ask = (token, commands) =>
  page.evaluate(
    ([query, messages]) =>
      new Promise((resolve) => {
        const socket = new WebSocket(`wss://${location.host}/ws${query}`, "seerob.v2.msgpack");
        let opened = false;
        socket.onopen = () => {
          opened = true;
          for (const message of messages) socket.send(new Uint8Array(message));
          setTimeout(() => socket.close(), 300);
        };
        socket.onclose = () => resolve(opened);
      }),
    [token ? `?token=${token}` : "", commands.map((command) => [...encode(command)])],
  );

const time = () => page.evaluate(() => window.seerob.t);

test("who controls plays it; the token is gone from the address, and no script has it", async () => {
  await show(page, served.urls.control);
  assert.match(page.url(), /^https:\/\/127\.0\.0\.1:\d+\/$/);
  assert.equal(await page.evaluate(() => document.cookie), "");
  const [cookie] = await browser.context.cookies();
  assert.deepEqual([cookie.secure, cookie.httpOnly, cookie.sameSite], [true, true, "Lax"]);
  await page.getByRole("button", { name: "Play (space)" }).click();
  await page.waitForFunction(() => window.seerob.t > 0.2);
  await page.getByRole("button", { name: "Pause (space)" }).click();
  await page.getByRole("button", { name: "Play (space)" }).waitFor();
  assert.deepEqual(browser.complaints, []);
});

test("who looks on has no button that works, and is refused when they ask all the same", async () => {
  await browser.context.clearCookies();
  await show(page, served.urls.view);
  const before = await time();
  for (const button of await page.locator(".transport button").all()) {
    assert.equal(await button.isDisabled(), true, await button.innerText());
  }
  await page.getByText("looks on").waitFor();
  await page.keyboard.press("End");
  await page.keyboard.press("Space");
  const box = await page.locator(".strip").boundingBox();
  await page.mouse.click(box.x + box.width / 2, box.y + box.height / 2);
  const commands = ["play", "pause"].map((action) => ({ type: "command", action, value: null }));
  const seek = { type: "command", action: "seek", value: 20 };
  assert.equal(await ask("", [seek, ...commands]), true);
  assert.equal(await time(), before);
});

test("a wrong token opens neither page nor WebSocket", async () => {
  const wrong = "0123456789abcdef".repeat(2);
  assert.equal(await ask(wrong, []), false);
  await browser.context.clearCookies();
  const answer = await page.goto(served.url.replace(/token=.*/, `token=${wrong}`));
  assert.equal(answer.status(), 401);
  assert.equal(await page.evaluate(() => "seerob" in window), false);
  assert.equal(await ask("", []), false);
});

test("a browser that does not trust the authority shows nothing", async () => {
  const stranger = await openBrowser();
  try {
    await assert.rejects(stranger.page.goto(served.urls.view), /ERR_CERT_AUTHORITY_INVALID/);
  } finally {
    await stranger.close();
  }
});
