// What this browser keeps for one workstation: views that were saved, and panels that are folded away.

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

const MOST_VIEWS = 20;

export const views: Signal<readonly SavedView[]> = signal([]);
export const folded: Signal<readonly Panel[]> = signal([]);

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

const keyOf = (title: string): string => `seerob.view.${title}`;
let title: string | null = null;

effect(() => {
  const next = scene.value?.title ?? null;
  if (next === null || next === title) return;
  title = null; // nothing of another workstation is kept for this one
  const kept = read(next);
  views.value = kept.views;
  folded.value = kept.folded;
  title = next;
});

effect(() => {
  const now = JSON.stringify({ views: views.value, folded: folded.value });
  if (title === null) return;
  try {
    localStorage.setItem(keyOf(title), now);
  } catch {
    // Private windows may refuse: then it holds until the page is closed.
  }
});

function read(of: string): { views: SavedView[]; folded: Panel[] } {
  try {
    const kept = JSON.parse(localStorage.getItem(keyOf(of)) ?? "{}");
    const found: SavedView[] = Array.isArray(kept.views) ? kept.views.filter(isView) : [];
    return { views: found, folded: PANELS.filter((one) => kept.folded?.includes?.(one)) };
  } catch {
    return { views: [], folded: [] };
  }
}

const isPoint = (point: unknown): boolean =>
  Array.isArray(point) && point.length === 3 && point.every(Number.isFinite);

function isView(view: SavedView): boolean {
  return typeof view?.name === "string" && isPoint(view.position) && isPoint(view.target);
}
