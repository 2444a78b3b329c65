// A live run in a real browser, from the real server.

import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { assertShown, open, settled, show } from "./expect.mjs";

const HOSTILE = "<img src=x onerror=window.hacked=1>";
let opened;
let served;
let browser;
let page;

before(async () => {
  opened = await open(["--mode", "live"]);
  ({ served, browser, page } = opened);
});

after(() => opened?.close());

/** A busy machine sends nothing for a while now and then, and the page says so: it is looked at again, for a while. */
async function eventually(check) {
  const end = Date.now() + 120_000;
  for (;;) {
    try {
      return await check();
    } catch (error) {
      if (Date.now() > end) throw error;
      await page.waitForTimeout(200);
    }
  }
}

test("nothing comes from elsewhere, nothing complains, memory is shared", async () => {
  assert.equal(await page.evaluate(() => globalThis.crossOriginIsolated), true);
  assert.deepEqual(browser.outside, []);
  assert.deepEqual(browser.complaints, []);
});

test("names from files are shown as text, and only as text", async () => {
  assert.equal(await page.evaluate(() => globalThis.hacked), undefined);
  assert.equal(await page.textContent("h1"), `UR10 assembly ${HOSTILE}`);
  assert.equal(await page.getByRole("button", { name: HOSTILE, exact: true }).count(), 1);
  assert.equal(await page.locator("img[src=x]").count(), 0);
});

test("the table says values, units, limits and words; UNDECIDED gives its reason and its own look", async () => {
  await eventually(async () => {
    const speed = await page.locator('tr[data-criterion="tcp speed"]').innerText();
    assert.match(speed, /0\.\d{3}\sm\/s[\s\S]*≤\s0\.7\sm\/s[\s\S]*(within|exceeded)/);
    const mass = page.locator('tr[data-criterion="effective mass"]');
    assert.match(await mass.innerText(), /–\skg[\s\S]*undecided/);
    assert.equal(await mass.locator(".badge-icon").innerText(), "?");
    const reason = await page.locator("tr.explanation", { hasText: "given by nobody" }).innerText();
    assert.match(reason, /mass of ur10\/shoulder_link was given by nobody/);
    const looks = await page.evaluate(() => {
      const look = (name) => {
        const row = document.querySelector(`tr[data-criterion="${name}"]`);
        const style = getComputedStyle(row.querySelector("td"));
        const icon = getComputedStyle(row.querySelector(".badge-icon"));
        return [style.backgroundImage, icon.borderStyle, getComputedStyle(row.querySelector(".badge")).color];
      };
      return { undecided: look("effective mass"), within: look("work area") };
    });
    assert.match(looks.undecided[0], /gradient/);
    for (const [i, style] of looks.undecided.entries()) assert.notEqual(style, looks.within[i]);
  });
});

test("a figure in the room is that of the table, in every picture", async () => {
  const pairs = await page.evaluate(
    () =>
      new Promise((done) => {
        const found = [];
        const row = document.querySelector('tr[data-criterion="separation"] .value');
        const look = () => {
          const label = window.seerob.written.find((text) => text.startsWith("separation: "));
          if (label) found.push([label, row.textContent]);
          if (new Set(found.map(String)).size < 4) requestAnimationFrame(look);
          else done(found);
        };
        look();
      }),
  );
  // This made-up criterion writes whole millimetres.
  const off = ([label, value]) => Math.abs(Number.parseFloat(label.slice(12)) / 1000 - Number(value));
  assert.deepEqual(
    pairs.filter((pair) => off(pair) > 6e-4),
    [],
  );
});

test("what gets worse is told at once: no table says within for long beside what is drawn as exceeded", async () => {
  const late = await page.evaluate(
    () =>
      new Promise((done) => {
        const badge = document.querySelector('tr[data-criterion="separation"] .badge');
        let [t, drawn, behind, most, turns] = [0, "", 0, 0, 0];
        const look = () => {
          const verdict = window.seerob.drawn.separation;
          if (window.seerob.t !== t) {
            behind = verdict === "exceeded" && badge.textContent.includes("within") ? behind + 1 : 0;
            most = Math.max(most, behind);
            turns += verdict === "exceeded" && drawn !== verdict;
            [t, drawn] = [window.seerob.t, verdict];
          }
          if (turns < 3) requestAnimationFrame(look);
          else done(most);
        };
        look();
      }),
  );
  assert.ok(late <= 3, `${late} instants`);
});

test("the worst comes first and the pill names it", async () => {
  // Rows change their order at most twice a second, so for a moment the worst may be below.
  await page.waitForFunction(() => {
    const rank = ["exceeded", "undecided", "no result", "within, close", "within", "informs"];
    const badges = [...document.querySelectorAll("tr[data-criterion] .badge")];
    const ranks = badges.map((badge) => rank.findIndex((word) => badge.textContent.trim().endsWith(word)));
    return !ranks.includes(-1) && ranks[0] === Math.min(...ranks);
  });
  await eventually(async () => {
    assert.match(await page.locator("output.pill").innerText(), /LIMIT EXCEEDED|UNDECIDED/);
  });
});

test("rows stay where they are below a pointer that moves, and are in order again when it has left", async () => {
  const order = () =>
    page.evaluate(() => {
      const rows = [...document.querySelectorAll("tr[data-criterion]")];
      return rows.map((row) => [row.dataset.criterion, row.querySelector(".badge").textContent]);
    });
  const names = (rows) => rows.map(([name]) => name);
  const { x, y, height } = await page.locator("tr[data-criterion]").first().boundingBox();
  await page.mouse.move(x + 20, y + height / 2);
  // What was to change places before the pointer came has done so.
  let before = await order();
  for (let after = null; String(after) !== String(before); ) {
    before = after ?? before;
    await page.mouse.move(x + 20 + Math.random(), y + height / 2);
    await page.waitForTimeout(300);
    after = await order();
  }
  // Until a verdict has changed, and for longer than rows may stay out of order.
  let changed = null;
  for (let step = 0; changed === null || Date.now() < changed + 1_500; step += 1) {
    await page.mouse.move(x + 20 + (step % 5), y + height / 2);
    const now = await order();
    assert.deepEqual(names(now), names(before));
    if (JSON.stringify(now) !== JSON.stringify(before)) changed ??= Date.now();
  }
  await page.mouse.move(1, 1);
  await page.waitForFunction(
    (was) =>
      [...document.querySelectorAll("tr[data-criterion]")].some((row, i) => row.dataset.criterion !== was[i]),
    names(before),
  );
});

test("a row opens to its basis: formula, source, inputs with origin, what is not modelled", async () => {
  const row = page.locator('tr[data-criterion="separation"]');
  await row.getByRole("button", { expanded: false }).click();
  const details = page.locator("tr.details");
  const text = await details.innerText();
  for (const said of [
    "S_p = v_h (T_r + T_s)",
    "5.5.4.2.3, Eq. 2",
    "stated",
    "missing",
    "uncertainty of the person's position",
  ]) {
    assert.ok(text.includes(said), said);
  }
  await row.getByRole("button", { expanded: true }).click();
  assert.equal(await details.count(), 0);
});

test("a page that comes late has the whole past, in lanes and plots on one axis with one cursor", async () => {
  await page.waitForFunction(() => window.seerob.t > 4);
  const late = await browser.context.newPage();
  await late.setViewportSize({ width: 1280, height: 800 });
  await show(late, served.url);
  const joined = await late.evaluate(() => window.seerob.t);
  const axis = () =>
    late.locator(".strip").evaluate((strip) => [strip.ariaValueMin, strip.ariaValueMax].map(Number));
  await late.waitForFunction(() => Number(document.querySelector(".strip").ariaValueMin) < 0.5);
  assert.ok(joined > 4);
  // A lane has its colour where the page was not there yet, and the plot beside it has a line.
  await late.waitForFunction((t) => {
    const strip = document.querySelector(".strip");
    const [first, last] = [strip.ariaValueMin, strip.ariaValueMax].map(Number);
    const x = Math.round((strip.width * (t - first)) / (last - first));
    const [r, g, b] = strip
      .getContext("2d")
      .getImageData(x, (7 * strip.height) / strip.clientHeight, 1, 1).data;
    return Math.abs(r - 0x1a) + Math.abs(g - 0x22) + Math.abs(b - 0x2d) > 12;
  }, joined / 2);
  await late.getByRole("button", { name: "10 s", exact: true }).click();
  await late.waitForFunction(() => {
    const { ariaValueMin, ariaValueMax } = document.querySelector(".strip");
    return Math.abs(ariaValueMax - ariaValueMin - 10) < 1e-6;
  });
  await late.waitForFunction((t) => window.seerob.t > t + 4, joined);
  await late.keyboard.press("Space");
  await late.waitForSelector(".behind");
  const held = await settled(late);
  // The axis stands still while one looks back, and plots are drawn on it in a moment.
  const [first, last] = await axis();
  const behind = await late.locator(".behind").innerText();
  await late.waitForFunction((text) => document.querySelector(".behind").innerText !== text, behind);
  assert.deepEqual(await axis(), [first, last]);
  const over = await late.locator(".plot .u-over").first().boundingBox();
  const share = (held - 3 - first) / (last - first);
  await late.mouse.click(over.x + over.width * share, over.y + over.height / 2);
  // The first snapshot that was kept from there on; a loaded machine receives few.
  await late.waitForFunction(
    ([from, to]) => window.seerob.t >= from && window.seerob.t < to,
    [held - 3.1, held - 1],
  );
  await late.close();
});

test("a live run that falls behind real time is said to, and by how much", async () => {
  await eventually(async () => assert.equal(await page.locator(".source").innerText(), "live"));
  let behind = 0;
  await eventually(async () => {
    behind += 1.25;
    await served.tell("slip");
    const said = { hasText: `live – behind real timeby ${(Math.ceil(10 * behind) / 10).toFixed(1)} s` };
    // For three seconds of the run, which a loaded machine may need to draw the page once.
    await page.locator(".source.source-slow", said).waitFor({ timeout: 3000 });
    assert.match(await page.locator(".source").getAttribute("title"), /too slow .* or was suspended/);
    await page.locator(".source.source-live", said).waitFor();
    assert.doesNotMatch(await page.locator(".source").getAttribute("title"), /slow/);
    // How much is not read out at each tenth of a second.
    assert.equal(await page.locator(".source [role=status]").innerText(), "live – behind real time");
  });
});

test("a live run that falls silent is said to be silent, and nothing stays green", async () => {
  await served.tell("freeze");
  await page.waitForSelector(".pill.state-off");
  // A last frame may still be on its way where the machine is loaded.
  await page.waitForSelector(".criteria table.stale");
  await page.locator(".source", { hasText: "nothing heard" }).waitFor();
  await page.locator(".legend").waitFor({ state: "detached" });
});

test("every body is where the last snapshot has it, turned from z-up to y-up", async () => {
  await assertShown(page, served, await settled(page));
});

test("looking back shows an earlier instant; L follows again", async () => {
  await served.tell("go");
  await page.waitForSelector(".pill:not(.state-off)");
  const resumed = await page.evaluate(() => window.seerob.t);
  await page.waitForFunction((t) => window.seerob.t > t + 1.5, resumed);
  const newest = await page.evaluate(() => window.seerob.t);
  await page.keyboard.press("Space");
  await page.waitForSelector(".behind");
  const held = await settled(page);
  assert.ok(held >= newest);
  await page.keyboard.press("Shift+ArrowLeft");
  await page.waitForFunction((t) => window.seerob.t < t, held);
  const back = await settled(page);
  // The first snapshot that was kept from a second before on; a loaded machine receives few.
  assert.ok(back >= held - 1.001 && back < held, `${back} is not at most a second before ${held}`);
  await assertShown(page, served, back);
  await page.keyboard.press("l");
  await page.waitForFunction((t) => window.seerob.t > t + 0.2, held);
  assert.equal(await page.locator(".behind").count(), 0);
});

test("what was worse before is named beside what is now, and a click goes to its worst instant", async () => {
  await page.keyboard.press("l");
  // Something exceeded goes by every few seconds; the note is there while nothing is.
  const found = await page.waitForFunction(() => {
    const text = document.querySelector(".pill")?.textContent ?? "";
    const told = text.match(
      /EXCEEDED SO FAR.*now .*exceeded (?:just now|\d+ (?:s|min) ago): ([a-z ]+?)(?: \+\d+)*$/,
    );
    if (!told) return null;
    document.querySelector(".pill-elsewhere").click();
    return told[1];
  });
  const named = await found.jsonValue();
  await page.waitForSelector(".visited");
  const seen = await page.locator(".visited").innerText();
  assert.ok(seen.includes(`Worst of ${named}: `), seen);
  assert.match(seen, /· \d+:\d\d\.\d\d/);
  if (seen.includes("older than")) {
    await page.getByRole("button", { name: "close" }).click();
  } else {
    const [, minutes, seconds] = seen.match(/· (\d+):(\d\d\.\d\d)/);
    const shown = await page.waitForFunction(
      (t) => Math.abs(window.seerob.t - t) < 0.006 && window.seerob.t,
      Number(minutes) * 60 + Number(seconds),
    );
    const { results } = await served.tell(`snapshot ${await shown.jsonValue()}`);
    assert.equal(results.find((r) => r.name === named).verdict, "exceeded");
    await page.getByRole("button", { name: "back to live" }).click();
  }
  await page.waitForFunction(() => !document.querySelector(".visited, .behind"));
});

test("findings are one click away", async () => {
  await page.getByRole("tab", { name: /Findings/ }).click();
  const levels = await page.locator(".finding-level").allInnerTexts();
  assert.deepEqual(
    levels.map((text) => text.replace(/^\S+\s/, "")),
    ["warning", "assumed", "note"],
  );
  await page.getByRole("tab", { name: "Criteria" }).click();
});

test("the tree selects, filters and hides", async () => {
  await page.getByRole("searchbox").fill("wrist_2");
  await page.getByRole("button", { name: "wrist_2_link", exact: true }).click();
  assert.match(
    await page.locator(".properties").innerText(),
    /ur10\/wrist_2_link[\s\S]*not given[\s\S]*envelope/,
  );
  await page.getByRole("button", { name: "Hide ur10/wrist_2_link" }).click();
  assert.equal(await page.getByRole("button", { name: "Show ur10/wrist_2_link" }).count(), 1);
  await page.getByRole("button", { name: "Show ur10/wrist_2_link" }).click();
  await page.getByRole("searchbox").fill("");
});

test("a lost server greys everything out; the page finds it again by itself", async () => {
  await served.tell("stop");
  await page.waitForSelector(".pill.state-off");
  // That nothing is heard a busy browser may know before it knows why.
  await eventually(async () => {
    assert.match(await page.locator(".pill").innerText(), /NO CURRENT DATA/);
    assert.match(await page.locator(".source").innerText(), /disconnected|connecting/);
    assert.equal(await page.locator(".criteria table.stale").count(), 1);
  });
  await served.tell("start");
  await page.waitForSelector(".pill:not(.state-off)");
  await page.waitForFunction(() => !document.querySelector(".criteria table.stale"));
});

test("while the run is stopped as a whole the page says so by its own clock, and then shows the present only", async () => {
  await page.evaluate(() => {
    window.pictures = [];
    const look = (at) => {
      const current = !document.querySelector(".pill.state-off") || !document.querySelector("table.stale");
      window.pictures.push({ at, t: window.seerob.t, current });
      requestAnimationFrame(look);
    };
    requestAnimationFrame(look);
  });
  let stopped;
  served.signal("SIGSTOP");
  try {
    await page.waitForSelector(".pill.state-off");
    await page.waitForTimeout(2000);
    // Once the run goes on, a busy machine may ask only when the page shows the present again.
    stopped = await page.evaluate(() => window.pictures.at(-1).t);
    assert.match(await page.locator(".source").innerText(), /nothing heard/);
    assert.equal(await page.locator(".criteria .badge:not(.state-off)").count(), 0);
    assert.equal(await page.locator(".legend").count(), 0);
  } finally {
    served.signal("SIGCONT");
  }
  await page.waitForFunction(
    (before) => window.pictures.some(({ t, current }) => t > before && current),
    stopped,
  );
  const pictures = await page.evaluate(() => window.pictures);
  const slowest = Math.max(...pictures.slice(1).map(({ at }, i) => at - pictures[i].at));
  const begun = pictures.find(({ t }) => t === stopped).at;
  const late = pictures.filter(
    ({ at, t, current }) => t === stopped && current && at - begun > 500 + slowest,
  );
  assert.deepEqual(late, []);
  const next = pictures.find(({ t, current }) => t > stopped && current);
  assert.ok(next.t > stopped + 1.9, `${next.t} is of before the run went on, ${stopped}`);
});

test("a narrow screen loses nothing to the right", async () => {
  await page.setViewportSize({ width: 1024, height: 700 });
  const row = page.locator('tr[data-criterion="arm energy"]');
  await row.getByRole("button", { expanded: false }).click();
  const list = await page
    .locator(".criteria")
    .evaluate((element) => element.scrollWidth - element.clientWidth);
  assert.ok(list <= 0, `the table is ${list} px too wide`);
  const over = await page.evaluate(() => document.documentElement.scrollWidth - innerWidth);
  assert.ok(over <= 0);
  for (const selector of [".pill", ".criteria td.state .badge", ".transport", ".strip"]) {
    const box = await page.locator(selector).first().boundingBox();
    assert.ok(box && box.x >= 0 && box.x + box.width <= 1024, selector);
  }
});
