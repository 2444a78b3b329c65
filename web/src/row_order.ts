// The order of the table: worst first, but rows may not jump while one reads them.

import { computed, effect, signal, untracked } from "@preact/signals";
import { type Row, rows } from "./page_state";
import { margin, STATE_ORDER } from "./verdicts";

/** Shortest time between two changes of order. */
const REORDER_MS = 500;

const order = signal<readonly string[]>([]);
let orderedAt = Number.NEGATIVE_INFINITY;
let due: ReturnType<typeof setTimeout> | null = null;

/** Rows of the table, worst first, in an order that changes at most twice a second. */
export const orderedRows = computed<Row[]>(() => {
  const byName = new Map(rows.value.map((row) => [row.info.name, row]));
  const ordered = order.value.flatMap((name) => byName.get(name) ?? []);
  return ordered.length === byName.size ? ordered : sorted(rows.value);
});

effect(() => {
  const next = sorted(rows.value).map((row) => row.info.name);
  if (untracked(() => same(next, order.value))) return;
  const wait = orderedAt + REORDER_MS - performance.now();
  if (wait <= 0) apply(next);
  else due ??= setTimeout(() => apply(sorted(rows.value).map((row) => row.info.name)), wait);
});

function apply(next: readonly string[]): void {
  if (due !== null) clearTimeout(due);
  due = null;
  orderedAt = performance.now();
  order.value = next;
}

function sorted(all: readonly Row[]): Row[] {
  return [...all].sort((a, b) => rank(a) - rank(b) || left(a) - left(b));
}

function rank(row: Row): number {
  return STATE_ORDER.indexOf(row.state);
}

function left(row: Row): number {
  return (row.result && margin(row.result)) ?? 0;
}

function same(a: readonly string[], b: readonly string[]): boolean {
  return a.length === b.length && a.every((name, i) => name === b[i]);
}
