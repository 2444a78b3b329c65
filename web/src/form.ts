// What is drawn of a run: its form, and its numbers. From one snapshot to the next numbers alone change mostly, and
// those go through shared memory: without a message, and without anything made anew for a picture.

import type { Shown } from "./messages";
import { type State, stateAt } from "./verdicts";

/** Before the numbers: run time [s], when that was heard [ms since 1970], whether it is silent. */
export const HEAD = 3;

/** What differs by less looks the same [m]: where everybody stands, what a twin settles to trembles by less. */
export const UNSEEN = 1e-6;

type Tree = { [key: string]: unknown };

/** What is written in the room is what the panels say, which come later. */
const isWritten = (key: string, value: unknown): boolean =>
  typeof value === "string" && (key === "label" || key === "text");

/** How many numbers a form has. */
export function countOf(form: unknown): number {
  if (typeof form === "number") return 1;
  if (typeof form !== "object" || form === null) return 0;
  let count = 0;
  for (const key in form) count += countOf((form as Tree)[key]);
  return count;
}

/** Put numbers one after another, as a form has them; where the next goes, and −1 for a value of another form. */
export function numbersOf(form: unknown, value: unknown, into: Float64Array, at: number): number {
  if (typeof form === "number") {
    if (typeof value !== "number") return -1;
    into[at] = value;
    return at + 1;
  }
  if (typeof form !== "object" || form === null || typeof value !== "object" || value === null)
    return form === value ? at : -1;
  let next = at;
  let keys = 0;
  for (const key in form) {
    keys += 1;
    const other = (value as Tree)[key];
    if (isWritten(key, other)) continue;
    next = numbersOf((form as Tree)[key], other, into, next);
    if (next < 0) return -1;
  }
  for (const _ in value) keys -= 1;
  return keys === 0 ? next : -1;
}

/** The page's end: something drawn whose numbers are changed in place. What is numbers alone is a typed array in it. */
export class Form {
  /** By each number, what holds it and by which name; null where that is a typed array. */
  private readonly holders: (Float64Array | Tree)[] = [];
  private readonly keys: (string | null)[] = [];
  private readonly firsts: number[] = [];
  /** By each result, where its value and its limit are; −1 where they are no numbers. */
  private readonly values: number[] = [];
  private readonly limits: number[] = [];

  constructor(readonly shown: Shown) {
    this.list(shown as unknown as Tree);
    const at = (k: number, key: string) => {
      const of: unknown = shown.results[k];
      return this.firsts[this.holders.findIndex((holder, i) => holder === of && this.keys[i] === key)] ?? -1;
    };
    for (let k = 0; k < shown.results.length; k += 1) {
      this.values.push(at(k, "value"));
      this.limits.push(at(k, "limit"));
    }
  }

  /** The state of a result; with other numbers, where they are given. */
  stateOf(k: number, numbers: Float64Array | null): State {
    const { value, limit, at_most, verdict } = this.shown.results[k]!;
    return stateAt(
      verdict,
      at_most,
      figure(numbers, this.values[k]!, value),
      figure(numbers, this.limits[k]!, limit),
    );
  }

  /** Take other numbers; whether it looks different now. */
  fill(numbers: Float64Array): boolean {
    let differs = false;
    for (let k = 0; !differs && k < this.values.length; k += 1)
      differs = this.stateOf(k, numbers) !== this.stateOf(k, null);
    const { holders, keys, firsts } = this;
    for (let i = 0; i < holders.length; i += 1) {
      const holder = holders[i]!;
      const key = keys[i]!;
      const next = numbers[HEAD + firsts[i]!]!;
      if (key === null) differs = taken(holder as Float64Array, numbers, HEAD + firsts[i]!) || differs;
      else {
        const before = (holder as Tree)[key] as number;
        if (next === before) continue;
        // Of a result's figures its state is seen.
        if (key !== "t" && key !== "value" && key !== "limit" && !(Math.abs(next - before) <= UNSEEN))
          differs = true;
        (holder as Tree)[key] = next;
      }
    }
    return differs;
  }

  private count = 0;

  private list(tree: Tree): void {
    for (const key in tree) {
      const value = tree[key];
      if (typeof value === "number") this.add(tree, key, 1);
      else if (Array.isArray(value) && value.length > 0 && value.every((x) => typeof x === "number")) {
        const typed = Float64Array.from(value);
        tree[key] = typed;
        this.add(typed, null, typed.length);
      } else if (typeof value === "object" && value !== null) this.list(value as Tree);
    }
  }

  private add(holder: Float64Array | Tree, key: string | null, count: number): void {
    this.holders.push(holder);
    this.keys.push(key);
    this.firsts.push(this.count);
    this.count += count;
  }
}

function figure(numbers: Float64Array | null, at: number, drawn: number | null): number {
  return numbers && at >= 0 ? numbers[HEAD + at]! : (drawn ?? Number.NaN);
}

function taken(into: Float64Array, numbers: Float64Array, from: number): boolean {
  let differs = false;
  for (let k = 0; k < into.length; k += 1) {
    const next = numbers[from + k]!;
    if (!(Math.abs(next - into[k]!) <= UNSEEN)) differs = true;
    into[k] = next;
  }
  return differs;
}
