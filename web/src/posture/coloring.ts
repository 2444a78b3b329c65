// What the manikin's colours say, as signals for the panel and the room.

import { computed, signal } from "@preact/signals";
import { frame, stale } from "../page_state";
import { type Coloring, type Palette, scored, tints } from "./scores";

/** Whether the posture panel is open: only then are bodies coloured by scores. */
export const postureShown = signal(false);
export const coloring = signal<Coloring>("parts");
export const palette = signal<Palette>("green to red");
const chosenScore = signal<string | null>(null);

/** Criterion whose components are shown; the first with scores unless another was chosen. */
export const shownScore = computed<string | null>(() => {
  const names = scored(frame.value?.results ?? []).map((result) => result.name);
  return names.includes(chosenScore.value ?? "") ? chosenScore.value : (names[0] ?? null);
});

export function chooseScore(name: string): void {
  chosenScore.value = name;
}

/** Colour per node; empty while bodies keep their own. */
export const manikinTints = computed<ReadonlyMap<string, number>>(() => {
  if (!postureShown.value || stale.value) return new Map();
  const result = frame.value?.results.find((r) => r.name === shownScore.value);
  return tints(result, coloring.value, palette.value);
});
