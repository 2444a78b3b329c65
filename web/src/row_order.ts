// The order of the table: worst first, but rows may not jump while one reads them.

import { computed, effect, signal, untracked } from "@preact/signals";
import { type Row, rows } from "./page_state";
import { margin, STATE_ORDER } from "./verdicts";

/** Shortest time between two changes of order. */
const REORDER_MS = 500;
/** Rows stay below a pointer that moved so recently. */
const AIMING_MS = 2_000;

const order = signal<readonly string[]>([]);
let orderedAt = Number.NEGATIVE_INFINITY;
let aimedAt = Number.NEGATIVE_INFINITY;
let due: ReturnType<typeof setTimeout> | null = null;

/** Say that a pointer moves over the table (`true`), or has left it. */
export function aim(over: boolean): void {
  aimedAt = over ? performance.now() : Number.NEGATIVE_INFINITY;
}

/** Rows of the table, worst first, in an order that changes at most twice a second, and not below a pointer. */
export const orderedRows = computed<Row[]>(() => {
  const byName = new Map(rows.value.map((row) => [row.info.name, row]));
  const ordered = order.value.flatMap((name) => byName.get(name) ?? []);
  return ordered.length === byName.size ? ordered : sorted(rows.value);
});

effect(() => {
  const next = namesSorted(rows.value);
  if (untracked(() => same(next, order.value))) return;
  reorder();
});

function reorder(): void {
  if (due !== null) return;
  const wait = Math.max(orderedAt + REORDER_MS, aimedAt + AIMING_MS) - performance.now();
  if (wait > 0) {
    due = setTimeout(() => {
      due = null;
      reorder();
    }, wait);
    return;
  }
  orderedAt = performance.now();
  order.value = namesSorted(rows.peek());
}

function namesSorted(all: readonly Row[]): string[] {
  return sorted(all).map((row) => row.info.name);
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
