// What is typed into a field is what it says, or it is said what is wrong with it; nothing is made up.

import assert from "node:assert/strict";
import { test } from "node:test";
import { load } from "./source.mjs";

const { list, listed, oneNumber, sideBySide } = await load("editing/typed");

const three = (...texts) => sideBySide(texts, [true, true, true], ["x", "y", "z"]);

test("cells side by side are all given, or none; a comma may stand before decimals", () => {
  assert.deepEqual(three("0,5", " 1.5", "-2"), { value: [0.5, 1.5, -2] });
  assert.deepEqual(three("", " ", ""), { value: undefined });
  assert.deepEqual(three("1", "", ""), { wrong: "missing: y, z" });
  assert.deepEqual(three("1", "a", "2"), { wrong: "a is no number" });
  assert.deepEqual(sideBySide(["table", "my robot"], [false, false], ["1", "2"]), {
    value: ["table", "my robot"],
  });
});

test("a number is one", () => {
  for (const [text, value] of [
    ["0,5", 0.5],
    [" -1e-3", -0.001],
    [".5", 0.5],
    ["", undefined],
  ])
    assert.deepEqual(oneNumber(text), { value });
  for (const text of ["1,2,3", "1 2", "0x10", "Infinity", "-"]) assert.ok("wrong" in oneNumber(text), text);
});

test("numbers of a list are separated by ; or blanks, words by , or ;", () => {
  for (const [text, value] of [
    ["0,5", [0.5]],
    ["1,5; 2,5", [1.5, 2.5]],
    ["1,5 2,5;3", [1.5, 2.5, 3]],
    ["0, -80, 90", [0, -80, 90]],
    ["[0,5, 1]", [0, 5, 1]],
    [" ", undefined],
  ])
    assert.deepEqual(list(text, true), { value }, text);
  for (const text of ["1,2,3", "1.5,2.5", "1; x", "[1, a]", '["1"]'])
    assert.ok("wrong" in list(text, true), text);
  for (const [text, value] of [
    ["Skull and forehead, Face", ["Skull and forehead", "Face"]],
    ["my cell; table", ["my cell", "table"]],
    ['["a, b", "c"]', ["a, b", "c"]],
    ["", undefined],
  ])
    assert.deepEqual(list(text, false), { value }, text);
});

test("a list that is shown is read as it is", () => {
  for (const value of [[0.5], [1, 2.5, -3e-9], []])
    assert.deepEqual(list(listed(value), true), { value: value.length > 0 ? value : undefined });
  for (const value of [["a b", "c"], ["a, b", "c"], ["[x]"], ["a;b"]])
    assert.deepEqual(list(listed(value), false), { value });
});
