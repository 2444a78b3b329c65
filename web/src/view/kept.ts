// What this browser keeps for one workstation: views that were saved, and where panels are, how wide, or folded away.

import { effect, type Signal, signal } from "@preact/signals";
import { scene } from "../page_state";

export interface SavedView {
  name: string;
  /** Of the eye and of what it looks at, three.js's own world [m]. */
  position: [number, number, number];
  target: [number, number, number];
}

export const PANELS = ["left", "right", "bottom"] as const;
export type Panel = (typeof PANELS)[number];

/** What stands beside each other between top and bottom. */
export const COLUMNS = ["left", "centre", "right"] as const;
export type Column = (typeof COLUMNS)[number];
type Widths = Partial<Record<Column, number>>;

const MOST_VIEWS = 20;
/** Of a panel [px], and of what it leaves of the window. */
const LEAST_PX = 150;
const MOST_SHARE = 0.6;

export const views: Signal<readonly SavedView[]> = signal([]);
export const folded: Signal<readonly Panel[]> = signal([]);
/** From left to right. */
export const order: Signal<readonly Column[]> = signal(COLUMNS);
/** Of panels whose width was chosen [px]. */
export const widths: Signal<Readonly<Widths>> = signal({});
/** Whether plots and time are above the room. */
export const timeAbove = signal(false);

export function saveView(view: Omit<SavedView, "name">): void {
  const taken = new Set(views.value.map(({ name }) => name));
  let n = 1;
  while (taken.has(String(n))) n += 1;
  views.value = [...views.value, { name: String(n), ...view }].slice(-MOST_VIEWS);
}

export function forgetView(name: string): void {
  views.value = views.value.filter((view) => view.name !== name);
}

export function toggleFolded(panel: Panel): void {
  folded.value = folded.value.includes(panel)
    ? folded.value.filter((one) => one !== panel)
    : [...folded.value, panel];
}

/** Change places with the neighbour on the left (-1) or the right (1). */
export function moveColumn(column: Column, step: -1 | 1): void {
  const next = [...order.value];
  const at = next.indexOf(column);
  const other = next[at + step];
  if (other === undefined) return;
  next[at + step] = column;
  next[at] = other;
  order.value = next;
}

/** Give a panel a width [px], or its own again. */
export function setWidth(column: Column, px: number | null): void {
  const { [column]: _, ...rest } = widths.value;
  const most = Math.max(MOST_SHARE * globalThis.innerWidth, LEAST_PX);
  widths.value =
    px === null ? rest : { ...rest, [column]: Math.round(Math.min(Math.max(px, LEAST_PX), most)) };
}

const keyOf = (title: string): string => `seerob.view.${title}`;
let title: string | null = null;

effect(() => {
  const next = scene.value?.title ?? null;
  if (next === null || next === title) return;
  title = null; // nothing of another workstation is kept for this one
  const kept = read(next);
  views.value = kept.views;
  folded.value = kept.folded;
  order.value = kept.order;
  widths.value = kept.widths;
  timeAbove.value = kept.timeAbove;
  title = next;
});

effect(() => {
  const now = JSON.stringify({
    views: views.value,
    folded: folded.value,
    order: order.value,
    widths: widths.value,
    timeAbove: timeAbove.value,
  });
  if (title === null) return;
  try {
    localStorage.setItem(keyOf(title), now);
  } catch {
    // Private windows may refuse: then it holds until the page is closed.
  }
});

interface Kept {
  views: SavedView[];
  folded: Panel[];
  order: readonly Column[];
  widths: Widths;
  timeAbove: boolean;
}

function read(of: string): Kept {
  let kept: Partial<Record<keyof Kept, unknown>> = {};
  try {
    kept = JSON.parse(localStorage.getItem(keyOf(of)) ?? "{}") ?? {};
  } catch {
    // Nothing, or nothing that this page wrote.
  }
  const list = (given: unknown): unknown[] => (Array.isArray(given) ? given : []);
  const columns = list(kept.order);
  const given = (kept.widths ?? {}) as Widths;
  return {
    views: list(kept.views).filter(isView),
    folded: PANELS.filter((one) => list(kept.folded).includes(one)),
    order: COLUMNS.every((one) => columns.includes(one)) ? (columns.slice(0, 3) as Column[]) : COLUMNS,
    widths: Object.fromEntries(
      COLUMNS.filter((one) => (given[one] ?? 0) > 0).map((one) => [one, given[one]]),
    ),
    timeAbove: kept.timeAbove === true,
  };
}

const isPoint = (point: unknown): boolean =>
  Array.isArray(point) && point.length === 3 && point.every(Number.isFinite);

function isView(given: unknown): given is SavedView {
  const view = given as SavedView;
  return typeof view?.name === "string" && isPoint(view.position) && isPoint(view.target);
}
