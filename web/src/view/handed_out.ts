// What one takes along of the instant that is shown: a file of it, and its figures.

import type { ToldResult } from "../messages";
import { frame, scene, stale } from "../page_state";

export function save(content: Blob, name: string): void {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(content);
  link.download = name;
  link.click();
  URL.revokeObjectURL(link.href);
}

/** `cell 12.34 s` as a file's name. */
export function fileName(ending: string): string {
  const title = (scene.peek()?.title ?? "seerob").replace(/[^\p{L}\p{N} ._-]+/gu, "_");
  return `${title} ${(frame.peek()?.t ?? 0).toFixed(2)} s.${ending}`;
}

/** Figures of the instant that is shown, in SI units as the engine has them. */
export function figures(): object {
  const now = frame.peek();
  const run = scene.peek();
  return {
    workstation: run?.title,
    workstation_hash: run?.workstation_hash,
    seerob: run?.version,
    t: now?.t,
    // A picture of what is no present any more is none of it either.
    stale: stale.peek(),
    results: (now?.results ?? []).map(figuresOf),
  };
}

const COLUMNS = ["name", "value", "unit", "limit", "at_most", "verdict", "low", "high", "reason"] as const;

function figuresOf({ name, value, unit, limit, at_most, verdict, interval, reason }: ToldResult) {
  const [low, high] = interval ?? [null, null];
  return { name, value, unit, limit, at_most, verdict, low, high, reason };
}

/** The same as a table: a row per criterion, the instant [s] before it. */
export function figuresTable(): string {
  const now = frame.peek();
  const rows = (now?.results ?? []).map((result) => {
    const of = figuresOf(result);
    return [now?.t, ...COLUMNS.map((column) => of[column])].map(cell).join(",");
  });
  return `${["t [s]", ...COLUMNS].join(",")}\r\n${rows.map((row) => `${row}\r\n`).join("")}`;
}

// A text that a spreadsheet could take for a formula is none.
function cell(value: unknown): string {
  if (value === null || value === undefined) return "";
  if (typeof value !== "string") return String(value);
  const text = /^[=+\-@\t\r]/.test(value) ? `'${value}` : value;
  return /[",\r\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text;
}
