// The page writes numbers as the terminal and the report do: the same text for the same number.

import assert from "node:assert/strict";
import { test } from "node:test";
import { askPython } from "./python.mjs";
import { load } from "./source.mjs";

const { against, angleUnit, figure, gap, lengthUnit, percent, withUnit } = await load("figures");

const UNITS = ["m", "m/s", "J", "kg", "N", "s", "", "°", "N/cm²"];

/** Numbers of all sizes, beside limits of which some are equal or off by a hair; the same on every run. */
function* cases() {
  let seed = 7;
  const random = () => {
    seed = (1103515245 * seed + 12345) % 2 ** 31;
    return seed / 2 ** 31;
  };
  for (const unit of UNITS) {
    for (let k = 0; k < 200; k += 1) {
      const limit = (random() - 0.4) * 10 ** Math.floor(12 * random() - 6);
      const off = (random() - 0.5) * limit * 10 ** -Math.floor(15 * random());
      const value = k % 10 === 0 ? limit : limit + off;
      yield [value, limit, unit, random() < 0.5];
    }
    for (const value of [0, -0.5, 0.15, 1e-12, 1e21, 123456.78]) yield [value, 0, unit, false];
  }
}

test("figures and limits are written as the report writes them", async () => {
  const all = [...cases()];
  const told = await askPython(
    `import json, sys
from seerob.core.figures import against, figure
print(json.dumps([[*against(v, l, u, at_most=m), figure(v, "")] for v, l, u, m in json.load(sys.stdin)]))`,
    JSON.stringify(all),
  );
  const plain = (text) => text.replace(/[eE].*$/, "");
  assert.equal(told.length, all.length);
  for (const [i, [value, limit, unit, atMost]] of all.entries()) {
    const shown = against(value, limit, unit, atMost);
    const here = [shown.value, shown.limit, figure(value, "")].map(plain);
    assert.deepEqual(here, told[i].map(plain), `${value} against ${limit} ${unit}, ${atMost}`);
  }
});

test("what is left is never shown larger than it is, what is beyond never smaller", () => {
  for (const [value, limit, unit, atMost] of cases()) {
    if (Math.abs(value) >= 1e15) continue;
    const left = atMost ? limit - value : value - limit;
    const shown = Number(gap(value, limit, unit, atMost).replaceAll("−", "-"));
    assert.ok(
      shown <= left + 1e-11 * Math.max(Math.abs(value), Math.abs(limit)) + 1e-12,
      `${shown} of ${left}`,
    );
    if (left < 0) assert.ok(shown < 0);
  }
});

test("a share never flatters", () => {
  assert.deepEqual(
    [0.1299, -0.0004, 0.29, 0, 12, null, -0.131].map((share) => percent(share).replace("\u00a0", "")),
    ["12%", "−0.1%", "29%", "0%", ">999%", "–", "−14%"],
  );
  assert.deepEqual(
    [0.991, 1.0001, 0.29].map((share) => percent(share, "up").replace("\u00a0", "")),
    ["100%", "101%", "29%"],
  );
});

test("lengths in millimetres and angles in degrees are the same numbers, on the same side of their limits", () => {
  lengthUnit.value = "mm";
  angleUnit.value = "°";
  assert.deepEqual(against(0.50004, 0.5, "m", true), { value: "500.1", limit: "500" });
  assert.deepEqual(against(0.49996, 0.5, "m", false), { value: "499.9", limit: "500" });
  assert.equal(withUnit(against(0.25, 0.2, "m/s", true).value, "m/s"), "250\u00a0mm/s");
  assert.equal(withUnit(against(Math.PI / 2, 2, "rad", true).value, "rad"), "90\u00a0°");
  assert.equal(against(3, 4, "J", true).value, "3");
  lengthUnit.value = "m";
  angleUnit.value = "as given";
});
