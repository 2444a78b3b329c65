// The body map and the posture panel in a real browser: they say what the shown snapshot says, and lead on.

import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { open, settled, show } from "./expect.mjs";
import { load } from "./source.mjs";

const { against } = await load("figures");
let opened;
let served;
let browser;
let page;

before(async () => {
  opened = await open(["--mode", "replay", "--seconds", "12"], { width: 1280, height: 900 });
  ({ served, browser, page } = opened);
});

after(() => opened?.close());

async function seek(t) {
  const box = await page.locator(".strip").boundingBox();
  await page.mouse.click(box.x + (box.width * t) / 12, box.y + box.height / 2);
  await page.waitForFunction((to) => Math.abs(window.seerob.t - to) < 0.06, t);
  return settled(page);
}

const spot = (key) => page.locator(`[data-spot="${key}"]`);
const look = async (key) => (await spot(key).getAttribute("class")).match(/look-(\w+)/)[1];
/** A verdict within its limit may be close to it. */
const STATES = { within: "state-(within|close)", exceeded: "state-exceeded", undecided: "state-undecided" };
const tab = (name) => page.getByRole("tab", { name, exact: true }).click();

/** The row of an area in the snapshot of a run time. */
async function rowOf(t, area) {
  const { results } = await served.tell(`snapshot ${t}`);
  return results.find((r) => r.name === "contacts").rows.find((row) => row.areas?.includes(area));
}

test("every one of the 29 areas is on the body, on both sides where there are two", async () => {
  await tab("Body");
  const keys = await page.locator("[data-spot]").evaluateAll((all) => all.map((g) => g.dataset.spot));
  assert.deepEqual(
    [...new Set(keys.map((key) => Number(key.split(" ")[0])))].sort((a, b) => a - b),
    Array.from({ length: 29 }, (_, i) => i + 1),
  );
  assert.equal(new Set(keys).size, keys.length);
  for (const [dominant, other] of [
    [17, 18],
    [24, 25],
  ]) {
    assert.ok(keys.includes(`${dominant} right`) && keys.includes(`${other} left`));
  }
});

for (const t of [0.3, 1, 5.5, 8]) {
  test(`at ${t} s each area has the colour of its share`, async () => {
    const at = await seek(t);
    const expected = async (area) => {
      const row = await rowOf(at, area);
      if (!row) return "clear";
      const share = row.value / row.limit;
      if (share > 1) return "exceeded";
      if (row.verdict === "undecided") return "undecided";
      return share < 0.5 ? "low" : share < 0.8 ? "middle" : "high";
    };
    for (const [area, key] of [
      [8, "8 "],
      [9, "9 left"],
      [9, "9 right"],
      [14, "14 right"],
      [24, "24 right"],
    ]) {
      const wanted = await expected(area);
      await page.waitForFunction(
        ([k, l]) => document.querySelector(`[data-spot="${k}"]`).classList.contains(`look-${l}`),
        [key, wanted],
      );
    }
    // What one side can be hit at says nothing of the other.
    assert.equal(await look("14 left"), "clear");
    assert.equal(await look("25 left"), "clear");
  });
}

test("while the robot is not heard no area looks as if nothing moved near it, with the reason", async () => {
  await seek(10.7);
  await page.waitForFunction(() => document.querySelectorAll("[data-spot].look-undecided").length > 40);
  assert.equal(await page.locator("[data-spot]:not(.look-undecided)").count(), 0);
  assert.equal(await page.locator(".region:not(.look-undecided)").count(), 0);
  const head = await page.locator(".contact-head").innerText();
  assert.match(head, /undecided[\s\S]*ur10: not heard for 0\.[45]\d* s/i);
  assert.doesNotMatch(head, /within reach/);
});

test("contact that is not permitted is hatched, feet without a limit are grey, neither has a number", async () => {
  await seek(0.3);
  assert.equal(await look("1 "), "forbidden");
  const fill = await spot("1 ")
    .locator("circle:not(.target)")
    .evaluate((circle) => getComputedStyle(circle).fill);
  assert.match(fill, /url\(.*#forbidden-front/);
  const feet = page.locator('[data-region="Feet"]').first();
  assert.match(await feet.getAttribute("class"), /look-none/);
  assert.match(await spot("1 ").getAttribute("aria-label"), /contact not permitted$/);
});

test("a tap says speed, limit, what governs, what each limit allows, where from and how sure", async () => {
  const at = await seek(0.3);
  await spot("24 right").click();
  const row = await rowOf(at, 24);
  const figures = against(row.value, row.limit, "m/s", true);
  const text = await page.locator(".body-map").innerText();
  for (const said of [
    "Back of the hand (dominant)",
    "area 24",
    `${figures.value} of ${figures.limit} m/s`,
    "force, free, ur10/wrist_3_link",
    "allowed by pressure",
    "1 m/s",
    "Table A.2 (2S)",
    "stated",
  ]) {
    assert.ok(
      text.replaceAll("\u00a0", " ").toLowerCase().includes(said.toLowerCase()),
      `${said} is not in ${text}`,
    );
  }
  await spot("24 right").click();
});

test("keys go from area to area without moving time", async () => {
  const t = await settled(page);
  await page.locator('[data-spot][tabindex="0"]').first().focus();
  const key = () => page.evaluate(() => document.activeElement.dataset.spot);
  const first = await key();
  await page.keyboard.press("ArrowRight");
  const second = await key();
  assert.notEqual(second, first);
  await page.keyboard.press("Enter");
  assert.equal(await spot(second).getAttribute("aria-pressed"), "true");
  await page.keyboard.press("Enter");
  await page.keyboard.press("ArrowLeft");
  assert.equal(await key(), first);
  assert.equal(await settled(page), t);
});

test("one limit can be looked at by itself; what it does not know is undecided", async () => {
  await seek(1);
  await page.getByRole("button", { name: "Pressure" }).click();
  assert.equal(await look("14 right"), "undecided");
  await page.getByRole("button", { name: "Force" }).click();
  assert.notEqual(await look("14 right"), "undecided");
  await page.getByRole("button", { name: "Worst" }).click();
});

test("the posture has both sides, angles, and says what was not assessed", async () => {
  await tab("Posture");
  await seek(5.5);
  await page.waitForFunction(() => document.querySelector(".score-value").textContent === "7");
  const rows = await page.locator(".scores tbody tr").allInnerTexts();
  const flat = rows.map((text) => text.replace(/\s+/g, " "));
  assert.match(flat[0], /score 3\/7 7\/7/i);
  assert.match(
    flat[1],
    /upper arm 1\/6 shoulder flexion 6° −20° to 20° 5\/6 shoulder flexion 100° 20° to 45°/i,
  );
  assert.match(flat[3], /wrist – \? not assessed wrist flexion not measured/i);
});

test("the manikin has the colours of the parts, or of the whole, or its own", async () => {
  const color = (name) => page.evaluate((n) => window.seerob.tint(n), name);
  const [right, left] = ["operator/right upper arm", "operator/left upper arm"];
  await page.waitForFunction((n) => window.seerob.tint(n) !== null, right);
  const red = (hex) => (hex >> 16) - ((hex >> 8) & 255);
  assert.ok(red(await color(right)) > 60, "5 of 6 is warm");
  assert.ok(red(await color(left)) < -60, "1 of 6 is green");
  assert.equal(await color("operator/right hand"), null, "not assessed has no colour");
  await page.getByRole("button", { name: "Overall" }).click();
  await page.waitForFunction(([a, b]) => window.seerob.tint(a) === window.seerob.tint(b), [right, left]);
  await page.getByRole("button", { name: "Verdicts" }).click();
  await page.waitForFunction((n) => window.seerob.tint(n) === null, right);
  await page.getByRole("button", { name: "Body parts" }).click();
  await page.waitForFunction((n) => window.seerob.tint(n) !== null, right);
});

test("the manikin keeps its colours on every panel, with a legend, and the choice is remembered", async () => {
  const right = "operator/right upper arm";
  const kept = await page.evaluate((n) => window.seerob.tint(n), right);
  const legend = page.locator(".legend");
  for (const name of ["Criteria", "Body"]) {
    await tab(name);
    assert.equal(await page.evaluate((n) => window.seerob.tint(n), right), kept);
    assert.match(await legend.innerText(), /within[\s\S]*exceeded[\s\S]*undecided[\s\S]*by body part, best/);
  }
  await tab("Posture");
  await page.getByRole("button", { name: "Verdicts" }).click();
  await page.waitForFunction((n) => window.seerob.tint(n) === null, right);
  assert.doesNotMatch(await legend.innerText(), /best/);
  const other = await browser.context.newPage();
  await show(other, served.url);
  await other.getByRole("tab", { name: "Posture" }).click();
  const chosen = other.getByRole("button", { name: "Verdicts" });
  assert.equal(await chosen.getAttribute("aria-pressed"), "true");
  await other.close();
  await page.getByRole("button", { name: "Body parts" }).click();
  await page.waitForFunction((n) => window.seerob.tint(n) !== null, right);
});

test("arrows go from tab to tab without moving time", async () => {
  const t = await settled(page);
  const shown = () => page.locator('.tabs [aria-selected="true"]').evaluate((one) => one.id);
  await page.getByRole("tab", { name: "Posture" }).focus();
  await page.keyboard.press("ArrowLeft");
  assert.equal(await shown(), "tab-body");
  await page.keyboard.press("Home");
  assert.equal(await shown(), "tab-criteria");
  await page.keyboard.press("ArrowLeft");
  assert.equal(await shown(), "tab-findings");
  assert.equal(await page.evaluate(() => document.activeElement.id), "tab-findings");
  assert.equal(await page.evaluate(() => window.seerob.t), t);
});

test("body and posture are said in the language that is chosen", async () => {
  const words = () =>
    page
      .locator(
        ".choice button, .look-legend li, figcaption, .body-figure .side, .contact-details dt, .origin, .scores th, .angle",
      )
      .allTextContents();
  const titles = () =>
    page
      .locator(".body-figure svg, .spot, .link[title], .jump")
      .evaluateAll((all) => all.map((one) => one.getAttribute("aria-label") ?? one.getAttribute("title")));
  const language = page.locator("select", { has: page.locator("option", { hasText: "Deutsch" }) });
  const seen = {};
  await seek(5.5);
  for (const chosen of ["Deutsch", "English"]) {
    await language.selectOption({ label: chosen });
    seen[chosen] = [];
    for (const id of ["body", "posture"]) {
      await page.locator(`#tab-${id}`).click();
      await page.locator(`.${id === "body" ? "look-legend" : "scores"}`).waitFor();
      seen[chosen].push(...(await words()), ...(await titles()));
    }
  }
  const names = /^(Zone|contacts|posture score|tcp speed|separation)$/;
  const stayed = seen.Deutsch.filter((text) => seen.English.includes(text) && /[a-z]{3}/.test(text));
  assert.ok(seen.English.length > 80);
  assert.deepEqual(
    stayed.filter((text) => !names.test(text)),
    [],
  );
  await tab("Criteria");
});

test("the key W leads to the worst instant of the run where nothing is selected", async () => {
  await seek(10);
  await page.waitForSelector(".pill .now-undecided");
  await page.keyboard.press("Escape");
  await page.keyboard.press("w");
  await page.waitForSelector(".pill .now-exceeded");
});

test("a criterion's row and the key W lead to its worst instant too", async () => {
  await tab("Criteria");
  await seek(9);
  const twist = page.locator('tr[data-criterion="separation"] .twist');
  await twist.click();
  await page.locator('[data-worst="separation"]').click();
  const worst = await settled(page);
  const { results } = await served.tell(`snapshot ${worst}`);
  const { value, limit } = results.find((r) => r.name === "separation");
  for (let k = 0; k <= 1200; k += 25) {
    const one = (await served.tell(`snapshot ${k / 100}`)).results.find((r) => r.name === "separation");
    assert.ok(value - limit <= one.value - one.limit + 1e-6, `${k / 100} s is worse`);
  }
  await seek(9);
  await page.locator(".room canvas").evaluate((canvas) => canvas.focus());
  await page.keyboard.press("w");
  await page.waitForFunction((t) => Math.abs(window.seerob.t - t) < 0.006, worst);
  await twist.click();
});

test("the legend says of every criterion what it draws and in which state it is", async () => {
  await page.getByRole("button", { name: "Overlays" }).click();
  const list = page.locator(".overlay-list");
  const { results } = await served.tell(`snapshot ${await settled(page)}`);
  for (const { name, markers, verdict } of results) {
    const entry = list.locator("label").filter({ has: page.getByText(name, { exact: true }) });
    assert.equal(await entry.locator("svg").count(), new Set((markers ?? []).map((m) => m.type)).size, name);
    assert.match(
      await entry.locator(".badge").getAttribute("class"),
      verdict ? RegExp(STATES[verdict]) : /none/,
    );
  }
  await list.locator("input").first().focus();
  await page.keyboard.press("Escape");
  assert.equal(await list.count(), 0);
  await tab("Posture");
});

test("the worst instants lead to where the score is highest", async () => {
  await seek(9);
  await page.locator('[data-worst="posture score"]').click();
  await page.waitForFunction(() => window.seerob.t >= 4.99 && window.seerob.t < 6);
  await page.waitForFunction(() => document.querySelector(".score-value").textContent === "7");
});

test("posture and separation of the same instant stand in one row", async () => {
  const told = await page
    .locator(".trade tbody tr")
    .evaluateAll((all) => all.map((row) => [...row.children].map((cell) => cell.textContent.trim())));
  assert.ok(told.length >= 3);
  for (const [time, score, separation] of told) {
    const [minutes, seconds] = time.split(":").map(Number);
    const { results } = await served.tell(`snapshot ${60 * minutes + seconds}`);
    const value = (name) => results.find((r) => r.name === name).value;
    assert.equal(Number(score.match(/[\d.]+$/)[0]), value("posture score"));
    assert.ok(Math.abs(Number(separation.match(/[\d.]+$/)[0]) - value("separation")) < 6e-3);
  }
});

test("the pill leads to the worst instant of what it names, whose figures stay until the cursor moves on", async () => {
  await seek(10);
  await page.waitForSelector(".pill.state-exceeded .now-undecided");
  await page.locator(".pill-elsewhere").click();
  await page.waitForSelector(".pill.state-exceeded .now-exceeded");
  const seen = await page.locator(".visited").innerText();
  const at = await settled(page);
  const here = (await served.tell(`snapshot ${at}`)).results.find((r) => r.name === "separation");
  assert.ok(seen.includes(here.value.toFixed(3)), seen);
  let least = Number.POSITIVE_INFINITY;
  for (let k = 0; k <= 1200; k += 10) {
    const { results } = await served.tell(`snapshot ${k / 100}`);
    const one = results.find((r) => r.name === "separation");
    least = Math.min(least, one.value - one.limit);
  }
  assert.ok(here.value - here.limit <= least + 1e-6);
  // Figures of traces are those of results, not nearest numbers of half their digits.
  const { value, limit } = against(here.value, here.limit, "m", false);
  assert.ok(
    seen.replaceAll("\u00a0", " ").includes(`${value} m (≥ ${limit} m)`),
    `${seen}: ${value}, ${limit}`,
  );
  const marked = await page.evaluate(() => {
    const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
    const found = [];
    while (walker.nextNode())
      if (walker.currentNode.data.includes("✕")) found.push(walker.currentNode.parentElement);
    return found.map((element) => Boolean(element.closest("[class*=exceeded]")));
  });
  assert.ok(marked.length > 3 && marked.every(Boolean), "✕ stands on something that is not exceeded");
  await page.keyboard.press("ArrowRight");
  await page.waitForFunction(() => !document.querySelector(".visited"));
});

test("a phone held upright loses nothing to the right", async () => {
  await page.setViewportSize({ width: 390, height: 844 });
  for (const name of ["Criteria", "Body", "Posture"]) {
    await tab(name);
    const over = await page.evaluate(() => document.documentElement.scrollWidth - innerWidth);
    assert.ok(over <= 0, `${name} is ${over} px too wide`);
  }
});

for (const [width, height] of [
  [844, 390],
  [667, 375],
]) {
  test(`a phone held across (${width} × ${height}) shows room, verdict and time at once, none over another`, async () => {
    await page.setViewportSize({ width, height });
    await tab("Criteria");
    const over = await page.evaluate(() => document.documentElement.scrollWidth - innerWidth);
    assert.ok(over <= 0, `${over} px too wide`);
    const boxes = await Promise.all(
      [
        ".room canvas",
        ".legend",
        ".view-tools .tools",
        ".view-tools .overlays",
        ".right",
        ".clock",
        ".pill",
      ].map((one) => page.locator(one).first().boundingBox()),
    );
    const [room, legend, views, overlays, right, clock, pill] = boxes;
    assert.ok(room.height >= 190 && room.width >= 320, `the room has ${room.width} × ${room.height}`);
    for (const { x, y, width: wide, height: high } of boxes)
      assert.ok(x >= 0 && y >= 0 && x + wide <= width + 1 && y + high <= height, `${x} ${y} ${wide} ${high}`);
    for (const tools of [views, overlays])
      assert.ok(tools.y + tools.height < legend.y, "tools lie over the legend");
    assert.ok(room.x + room.width <= right.x + 1 && room.y + room.height <= clock.y + 1);
    assert.ok(pill.y + pill.height <= room.y + 1, "the pill lies over the room");
    assert.ok(await page.locator("tr[data-criterion] .badge").first().isVisible());
  });
}

test("nothing complained", () => assert.deepEqual(browser.complaints, []));
