// A recording in a real browser: one time cursor for the room, the table, the plots and the strip.

import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { assertShown, open, settled, show } from "./expect.mjs";
import { serve } from "./served.mjs";
import { load } from "./source.mjs";

const { against, steady } = await load("figures");
let opened;
let served;
let browser;
let page;

before(async () => {
  opened = await open(["--mode", "replay", "--seconds", "20"]);
  ({ served, browser, page } = opened);
});

after(() => opened?.close());

const reaches = (t) => page.waitForFunction((to) => Math.abs(window.seerob.t - to) < 0.006, t);

test("a click on the strip moves the cursor, the room and the numbers", async () => {
  const box = await page.locator(".strip").boundingBox();
  await page.mouse.click(box.x + box.width / 2, box.y + box.height / 2);
  await page.waitForFunction(() => Math.abs(window.seerob.t - 10) < 0.1);
  const t = await settled(page);
  const told = await assertShown(page, served, t);
  const { value, limit } = told.results.find((r) => r.name === "separation");
  await page.waitForFunction(
    (text) => document.querySelector('tr[data-criterion="separation"] .value').textContent === text,
    steady(against(value, limit, "m", false).value, "m"),
  );
  assert.equal(await page.locator(".strip").getAttribute("aria-valuenow"), String(t));
});

test("who may be elsewhere is hatched, in the tree, and in the legend; the rest is not", async () => {
  const box = await page.locator(".strip").boundingBox();
  const visit = async (t) => {
    await page.mouse.click(box.x + (box.width * t) / 20, box.y + box.height / 2);
    await page.waitForFunction((to) => Math.abs(window.seerob.t - to) < 0.1, t);
  };
  const doubted = (name, is) => page.waitForFunction(([n, d]) => window.seerob.doubted(n) === d, [name, is]);
  await visit(17.5);
  await doubted("ur10/forearm_link", true);
  await doubted("operator/right hand", false);
  await page.getByRole("img", { name: /^may be elsewhere: ur10: not heard for 0\.[45]\d s/ }).waitFor();
  assert.equal(await page.locator(".item .doubt").count(), 1);
  await page.locator(".legend").getByText("may be elsewhere").waitFor();
  // Its key has the colour that is drawn, dark and light.
  for (const [colorScheme, [r, g, b]] of [
    ["light", [0x6f, 0x7a, 0x88]],
    ["dark", [0x8a, 0x94, 0xa3]],
  ]) {
    await page.emulateMedia({ colorScheme });
    await page.waitForFunction(
      (color) => getComputedStyle(document.querySelector(".doubt-key i")).backgroundImage.includes(color),
      `rgb(${r}, ${g}, ${b})`,
    );
  }
  await visit(10);
  await doubted("ur10/forearm_link", false);
  await page.waitForFunction(() => !document.querySelector(".item .doubt, .doubt-key"));
});

test("arrows step by one snapshot, with shift by a second; Home and End go to the ends", async () => {
  const t = await settled(page);
  await page.keyboard.press("ArrowRight");
  await reaches(t + 0.01);
  await page.keyboard.press("ArrowLeft");
  await reaches(t);
  await page.keyboard.press("Shift+ArrowLeft");
  await reaches(t - 1);
  await assertShown(page, served, await settled(page));
  for (const [key, to] of [
    ["Home", 0],
    ["End", 20],
  ]) {
    await page.keyboard.press(key);
    await reaches(to);
  }
  await page.keyboard.press("Home");
  await reaches(0);
});

test("? says what the keys do, and time stands still behind it", async () => {
  const t = await settled(page);
  await page.keyboard.press("?");
  const said = page.getByRole("dialog", { name: "Keys" });
  await said.getByText("to the worst instant of the selected criterion").waitFor();
  await page.keyboard.press("ArrowRight");
  assert.equal(await settled(page), t);
  await page.keyboard.press("Escape");
  await said.waitFor({ state: "hidden" });
  await page.getByRole("button", { name: /^Keys/ }).click();
  await said.getByRole("button", { name: "close" }).click();
  await said.waitFor({ state: "hidden" });
});

test("a file that is dropped where none is edited stays, and the page says where it may go", async () => {
  const dropped = await page.evaluateHandle(() => {
    const data = new DataTransfer();
    data.items.add(new File(["x"], "line.step"));
    return data;
  });
  await page.dispatchEvent(".room", "drop", { dataTransfer: dropped });
  const note = page.getByRole("alert").filter({ hasText: "line.step" });
  await note.getByText("seerob edit").waitFor();
  await note.getByRole("button", { name: "Close" }).click();
  await note.waitFor({ state: "detached" });
});

test("] goes to where a limit begins to be exceeded, and [ back", async () => {
  const start = await settled(page);
  await page.keyboard.press("]");
  await page.waitForFunction((t) => window.seerob.t > t + 0.02, start);
  const t = await settled(page);
  const verdicts = async (at) =>
    (await served.tell(`snapshot ${at}`)).results.map((r) => r.verdict === "exceeded");
  const [now, just] = [await verdicts(t), await verdicts(t - 0.01)];
  assert.ok(
    now.some((exceeded, i) => exceeded && !just[i]),
    `nothing begins to be exceeded at ${t}`,
  );
  await page.waitForSelector(".pill.state-exceeded .now-exceeded");
  assert.match(await page.locator(".pill").innerText(), /✕[\s\S]*LIMIT EXCEEDED/);
  await page.keyboard.press("[");
  await page.waitForFunction((before) => window.seerob.t < before - 0.02, t);
});

test("the pill carries the verdict of the run, and says what is exceeded elsewhere", async () => {
  const box = await page.locator(".strip").boundingBox();
  await page.mouse.click(box.x + box.width / 2, box.y + box.height / 2);
  await page.waitForFunction(() => Math.abs(window.seerob.t - 10) < 0.1);
  const { results } = await served.tell(`snapshot ${await settled(page)}`);
  assert.ok(!results.some((r) => r.verdict === "exceeded"));
  await page.waitForSelector(".pill.state-exceeded .now-undecided");
  assert.match(await page.locator(".pill strong").innerText(), /^LIMIT EXCEEDED$/);
  assert.match(await page.locator(".pill-now").innerText(), /here[\s\S]*undecided/);
  const told = page.locator(".pill-elsewhere");
  assert.match(await told.innerText(), /✕ exceeded elsewhere: separation/);
  await page.keyboard.press("]");
  await page.waitForSelector(".pill.state-exceeded .now-exceeded");
  assert.equal(await told.count(), 0);
});

test("space plays at the chosen speed and pauses", async () => {
  await page.getByLabel("Speed", { exact: true }).selectOption("4");
  const start = await settled(page);
  await page.keyboard.press("Space");
  await page.waitForFunction((t) => window.seerob.t > t + 1, start);
  await page.keyboard.press("Space");
  await page.waitForSelector('button[aria-label="Play (space)"]');
  const t = await settled(page);
  await assertShown(page, served, t);
});

test("a click on a plot seeks too, and a lane's name selects its criterion everywhere", async () => {
  await page.locator(".lane-names button", { hasText: "tcp speed" }).click();
  assert.equal(await page.locator('tr[data-criterion="tcp speed"].selected').count(), 1);
  assert.equal(await page.locator(".plot.selected .plot-name").innerText(), "tcp speed");
  const over = await page.locator(".plot.selected .u-over").boundingBox();
  await page.mouse.click(over.x + over.width * 0.25, over.y + over.height / 2);
  await page.waitForFunction(() => Math.abs(window.seerob.t - 5) < 0.15);
});

test("where memory cannot be shared, poses come by message and are the same", async () => {
  const other = await browser.context.newPage();
  await other.route("**/*", async (route) => {
    const response = await route.fetch();
    const headers = { ...response.headers() };
    delete headers["cross-origin-opener-policy"];
    delete headers["cross-origin-embedder-policy"];
    await route.fulfill({ response, headers });
  });
  await show(other, served.url);
  assert.equal(await other.evaluate(() => globalThis.crossOriginIsolated), false);
  await other.keyboard.press("Shift+ArrowLeft");
  await assertShown(other, served, await settled(other));
  await other.close();
});

test("a mesh that cannot be had becomes a finding, and the rest is shown", async () => {
  const other = await browser.context.newPage();
  let refused = 0;
  await other.route("**/mesh/**", (route) => (refused++ === 0 ? route.abort() : route.continue()));
  await show(other, served.url);
  const findings = other.getByRole("tab", { name: /Findings/ });
  await findings.getByText("! 4").waitFor();
  await findings.click();
  assert.match(
    await other.locator(".findings").innerText(),
    /warning\s+ur10\/\w+\s+its mesh could not be fetched/,
  );
  await assertShown(other, served, await settled(other));
  await other.close();
});

test("another run is on the same axis, with its own lanes and figures, and in no verdict", async () => {
  const both = await serve("--mode", "replay", "--seconds", "20", "--beside");
  const other = await browser.context.newPage();
  await show(other, both.url);
  await other.locator(".beside").getByText("other <img src=x onerror=window.hacked=1>/run.mcap").waitFor();
  // The longer one is all on the axis.
  await other.waitForFunction(() => document.querySelector(".strip").ariaValueMax === "26");
  const strip = other.locator(".strip");
  const box = await strip.boundingBox();
  const visit = async (t) => {
    await other.mouse.click(box.x + (box.width * t) / 26, box.y + 4);
    await other.waitForFunction((to) => Math.abs(window.seerob.t - to) < 0.1, t);
  };
  await visit(10);
  const select = async (name) => {
    await other.locator(".lane-names button", { hasText: name }).click();
    return other.locator(".plot.selected");
  };
  const area = await select("work area");
  await area.locator(".plot-beside .badge.state-exceeded").waitFor();
  assert.match(await area.locator(".plot-beside").innerText(), /other <img[\s\S]*−0\.2500\sm/);
  assert.match(await area.locator("figcaption").innerText(), /0\.3000\sm[\s\S]*within/);
  // Each lane: what this run was above, what the other was below, also after this one's end.
  const names = await other.locator(".lane-names li").allInnerTexts();
  const tall = (await other.locator(".lane-names li").first().boundingBox()).height;
  const colour = async (name, t, below) => {
    const y = names.indexOf(name) * tall + (below ? 17 : 7);
    return strip.evaluate(
      (canvas, [x, at]) => {
        const k = devicePixelRatio;
        return [...canvas.getContext("2d").getImageData(Math.round(x * k), Math.round(at * k), 1, 1).data];
      },
      [(box.width * t) / 26, y],
    );
  };
  const [own, theirs, late, ended] = [
    await colour("work area", 6, false),
    await colour("work area", 6, true),
    await colour("work area", 24, true),
    await colour("work area", 24, false),
  ];
  assert.ok(own[1] > own[0], `${own} is not within`);
  assert.ok(theirs[0] > 2 * theirs[1], `${theirs} is not exceeded`);
  assert.deepEqual(late, theirs);
  assert.notDeepEqual(ended, own);
  // The other was undecided for a while, though it has figures there.
  const energy = await select("arm energy");
  await visit(6.5);
  await energy.locator(".plot-beside .badge.state-undecided").waitFor();
  await visit(10);
  await energy.locator(".plot-beside .badge.state-within, .plot-beside .badge.state-close").waitFor();
  assert.notDeepEqual(await colour("arm energy", 6.5, true), await colour("arm energy", 11, true));
  const told = await select("separation").then(() => other.locator(".criteria").innerText());
  assert.match(told, /work area/);
  // Nothing of it is counted, and ] goes to nothing of it.
  assert.doesNotMatch(await other.locator(".pill").innerText(), /work area/);
  assert.equal(await other.locator('tr[data-criterion="work area"] .badge.state-exceeded').count(), 0);
  assert.equal(await other.evaluate(() => window.hacked), undefined);
  // Another one is chosen in the page, for all pages, and none.
  const third = await browser.context.newPage();
  await show(third, both.url);
  await other.getByLabel("Another run").selectOption("later/run.mcap");
  await third.locator(".beside").getByText("dashed: later/run.mcap").waitFor();
  await other.waitForFunction(() => document.querySelector(".strip").ariaValueMax === "23");
  await other.locator(".plot-beside .badge.state-within").first().waitFor();
  await other.getByLabel("Another run").selectOption("–");
  await third.locator(".plot-beside").first().waitFor({ state: "detached" });
  await other.waitForFunction(() => document.querySelector(".strip").ariaValueMax === "20");
  await other.screenshot({ path: process.env.R3_SHOT ?? "/dev/null", type: "png" });
  await other.close();
  await both.close();
});

test("nothing complained", () => assert.deepEqual(browser.complaints, []));
