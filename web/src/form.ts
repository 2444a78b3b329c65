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

/**
 * The page's end: something drawn whose numbers are changed in place. What is numbers alone is a typed array in it, and
 * what differs with each picture, value and limit of a result, is kept beside it: a number in an object would be an
 * object of its own each time.
 */
export class Form {
  /** Lists of numbers, and where each begins in `numbers`. */
  private readonly lists: Float64Array[] = [];
  private readonly firsts: number[] = [];
  /** Numbers that stand alone: what has them, by which name, and where they are. */
  private readonly holders: Tree[] = [];
  private readonly keys: string[] = [];
  private readonly places: number[] = [];
  /** By each result, where its value and its limit are; −1 where they are no numbers. */
  private readonly values: number[] = [];
  private readonly limits: number[] = [];
  /** All numbers as they are now, after `HEAD` others. */
  readonly numbers: Float64Array;

  constructor(readonly shown: Shown) {
    const numbers: number[] = new Array(HEAD).fill(Number.NaN);
    this.list(shown as unknown as Tree, numbers);
    this.numbers = Float64Array.from(numbers);
    for (const result of shown.results) {
      const at = (key: string) => this.places[this.placeOf(result, key)] ?? -1;
      this.values.push(at("value"));
      this.limits.push(at("limit"));
    }
    // What differs with each picture and is not drawn itself.
    const beside = (holder: Tree, key: string): boolean =>
      key === "t" || ((key === "value" || key === "limit") && shown.results.includes(holder as never));
    for (let i = this.keys.length - 1; i >= 0; i -= 1)
      if (beside(this.holders[i]!, this.keys[i]!))
        for (const each of [this.holders, this.keys, this.places]) each.splice(i, 1);
  }

  /** The state of a result; with other numbers, where they are given. */
  stateOf(k: number, numbers: Float64Array | null): State {
    const { verdict, at_most } = this.shown.results[k]!;
    return stateAt(verdict, at_most, numbers ?? this.numbers, this.values[k]!, this.limits[k]!);
  }

  /** Take other numbers; whether it looks different now. */
  fill(numbers: Float64Array): boolean {
    let differs = false;
    for (let k = 0; k < this.values.length; k += 1) {
      if (this.stateOf(k, numbers) === this.stateOf(k, null)) continue;
      differs = true;
      // Whoever compares it with a result of another form finds the state that it has.
      const result = this.shown.results[k]!;
      if (this.values[k]! >= 0) result.value = numbers[this.values[k]!]!;
      if (this.limits[k]! >= 0) result.limit = numbers[this.limits[k]!]!;
    }
    for (let i = 0; i < this.lists.length; i += 1)
      if (taken(this.lists[i]!, numbers, this.firsts[i]!)) differs = true;
    const now = this.numbers;
    for (let i = 0; i < this.places.length; i += 1) {
      const at = this.places[i]!;
      if (numbers[at] === now[at]) continue;
      if (!(Math.abs(numbers[at]! - now[at]!) <= UNSEEN)) differs = true;
      this.holders[i]![this.keys[i]!] = numbers[at];
    }
    for (let at = HEAD; at < now.length; at += 1) now[at] = numbers[at]!;
    return differs;
  }

  private placeOf(holder: unknown, key: string): number {
    return this.holders.findIndex((one, i) => one === holder && this.keys[i] === key);
  }

  private list(tree: Tree, numbers: number[]): void {
    for (const key in tree) {
      const value = tree[key];
      if (typeof value === "number") {
        this.holders.push(tree);
        this.keys.push(key);
        this.places.push(numbers.length);
        numbers.push(value);
      } else if (Array.isArray(value) && value.length > 0 && value.every((x) => typeof x === "number")) {
        const typed = Float64Array.from(value);
        tree[key] = typed;
        this.lists.push(typed);
        this.firsts.push(numbers.length);
        for (const x of value) numbers.push(x);
      } else if (typeof value === "object" && value !== null) this.list(value as Tree, numbers);
    }
  }
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
