import assert from "node:assert/strict";
import fs from "node:fs";
import { test } from "node:test";
import { load } from "./source.mjs";

const { margin, stateOf, worstState, STATE_WORDS, STATE_ICONS, VERDICT_TEXT } = await load("verdicts");
const { formatFixed, formatNumber, formatTime, formatQuantity, shortened } = await load("format");

test("numbers have three digits, a true minus, and the limit's decimals", () => {
  assert.equal(formatNumber(0.12345), "0.123");
  assert.equal(formatNumber(-12.34), "−12.3");
  assert.equal(formatNumber(1234.5), "1235");
  assert.equal(formatNumber(-0.0001, 1), "−1.00e−4");
  assert.equal(formatNumber(0.9, 100), "1");
  assert.equal(formatNumber(-0.004, 10), "0.0");
  assert.equal(formatFixed(-0.004, 0), "0");
  assert.equal(formatFixed(-12.5, 1), "−12.5");
  assert.equal(formatNumber(null), "–");
  assert.equal(formatQuantity(0.61, "m"), "0.610\u00a0m");
  assert.equal(formatTime(83.456), "1:23.46");
  assert.equal(formatTime(59.999), "1:00.00");
});

test("a text that is too long keeps its begin and its end, where the figure is", () => {
  const text = `${"n".repeat(60)}: 0.7343 m`;
  const short = shortened(text, 48);
  assert.equal([...short].length, 48);
  assert.match(short, /^n+…n+: 0\.7343 m$/);
  assert.equal(shortened("as long as that", 15), "as long as that");
  assert.equal(shortened("🤖".repeat(9), 4), "🤖🤖…🤖");
});

test("the margin is positive on the admissible side, whichever that is", () => {
  assert.equal(margin({ value: 0.75, limit: 1, at_most: true }), 0.25);
  assert.equal(margin({ value: 0.75, limit: 1, at_most: false }), -0.25);
  assert.equal(margin({ value: -3, limit: -2, at_most: true }), 0.5);
  assert.equal(margin({ value: 1, limit: 0, at_most: true }), null);
});

test("nothing but WITHIN looks within, and the worst counts", () => {
  const of = (verdict, value = 0.5) => stateOf({ verdict, value, limit: 1, at_most: true });
  assert.deepEqual(
    [of("within"), of("within", 0.95), of("exceeded"), of("undecided"), of(null)],
    ["within", "close", "exceeded", "undecided", "none"],
  );
  assert.equal(worstState(["within", "missing", "none"]), "missing");
  assert.equal(worstState(["undecided", "exceeded", "within"]), "exceeded");
  assert.equal(worstState([]), "none");
  const words = Object.values(STATE_WORDS);
  assert.equal(new Set(words).size, words.length);
  assert.ok(!words.some((word) => /safe|certif|complian|pass|ok/i.test(word)));
  assert.notEqual(STATE_ICONS.undecided, STATE_ICONS.within);
});

test("text on panels has a contrast of at least 4.5", () => {
  const css = fs.readFileSync(new URL("../src/look/base.css", import.meta.url), "utf8");
  const [dark, light] = css
    .split('data-theme="light"')
    .map((part) =>
      Object.fromEntries([...part.matchAll(/--([\w-]+):\s*(#[0-9a-f]{6})/g)].map((m) => [m[1], m[2]])),
    );
  const texts = ["text", "text-2", "text-3", "within-text", "exceeded-text", "undecided-text", "off-text"];
  for (const color of [dark, light]) {
    for (const ground of ["ground", "panel", "raised"]) {
      for (const text of texts) {
        assert.ok(contrast(color[text], color[ground]) >= 4.5, `${text} on ${ground}`);
      }
    }
    assert.ok(contrast("#ffffff", color.exceeded) >= 4.5);
  }
  for (const text of Object.values(VERDICT_TEXT)) assert.ok(contrast(text, dark.ground) >= 4.5, text);
});

function luminance(hex) {
  const [r, g, b] = [1, 3, 5].map((i) => Number.parseInt(hex.slice(i, i + 2), 16) / 255);
  const linear = (c) => (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4);
  return 0.2126 * linear(r) + 0.7152 * linear(g) + 0.0722 * linear(b);
}

function contrast(a, b) {
  const [high, low] = [luminance(a), luminance(b)].sort((x, y) => y - x);
  return (high + 0.05) / (low + 0.05);
}

const { language, said, told } = await load("words");
const { angleUnit, lengthUnit, spoken } = await load("units");

test("a text is said in the chosen language, with its values, and in English where nobody translated it", () => {
  assert.equal(said("at {time}", { time: "1:02" }), "at 1:02");
  language.value = "de";
  assert.equal(said("at {time}", { time: "1:02" }), "bei 1:02");
  assert.equal(said("of no catalogue"), "of no catalogue");
  language.value = "en";
});

test("what the engine says is told by the same catalogues as in the report, with its values and its reason", () => {
  for (const code of ["de", "fr", "es", "it"]) {
    const file = new URL(`../../src/seerob/outputs/words/${code}.json`, import.meta.url);
    const catalogue = JSON.parse(fs.readFileSync(file, "utf8"));
    const filled = (text) => text.replace(/\{(\d+)\}/g, (_, n) => `N${n}`);
    const sentences = Object.entries(catalogue).filter(([text]) => /\{\d\}/.test(text));
    assert.ok(sentences.length > 120);
    language.value = code;
    for (const [text, translation] of sentences) assert.equal(told(filled(text)), filled(translation));
    assert.equal(
      told("ur10: no part moves; nothing touches; what a plug-in says"),
      `ur10: ${catalogue["no part moves"]}; ${catalogue["nothing touches"]}; what a plug-in says`,
    );
    assert.equal(
      told("neck flexion −3°, elbow flexion 11°").split(", ")[1],
      `${catalogue["elbow flexion"]} 11°`,
    );
  }
  language.value = "en";
});

test("a name stays as it is, though a button has the same word", () => {
  const file = new URL("../../src/seerob/outputs/words/de.json", import.meta.url);
  const labels = ["laser", "stop", "hold", "run", "section", "level", "ghost", "robot", "left", "Stop"];
  const german = JSON.parse(fs.readFileSync(file, "utf8"));
  for (const code of ["de", "fr", "es", "it"]) {
    language.value = code;
    const late = "not heard for 0.4 s (time-out 0.2 s)";
    assert.notEqual(told(late), late);
    for (const name of labels) {
      assert.ok(name in german);
      assert.equal(told(name), name);
      assert.equal(told(`${name}: ${late}`), `${name}: ${told(late)}`);
      assert.equal(told(`${name}, table`), `${name}, table`);
    }
    assert.notEqual(told("knee"), "knee");
    assert.notEqual(said("stop"), "stop");
  }
  language.value = "en";
});

test("figures in sentences are in the chosen units, lengths without rounding", () => {
  const text = "0.3 to 0.50 m, at 1.6 m/s, of 0.02 m² and 0.05 rad or m; −0.1501 m; 12 kg; 1e-05 m; 35° away";
  assert.equal(spoken(text), text);
  lengthUnit.value = "mm";
  angleUnit.value = "rad";
  assert.equal(
    spoken(text),
    "300 to 500 mm, at 1600 mm/s, of 0.02 m² and 0.05 rad or m; −150.1 mm; 12 kg; 1e-05 m; 0.611 rad away",
  );
  lengthUnit.value = "m";
  angleUnit.value = "°";
  assert.equal(spoken("off by 0.5 rad, more than 0.1 rad/s"), "off by 28.6°, more than 5.73°/s");
  angleUnit.value = "as given";
});
