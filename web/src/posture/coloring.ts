// What the manikin's colours say, as signals for the panel, the legend and the room.

import { computed, signal } from "@preact/signals";
import { frame, scene, stale } from "../page_state";
import { remembered } from "../remembered";
import { COLORINGS, type Coloring, PALETTES, type Palette, scored, tints } from "./scores";

/** What colours the manikin, whichever panel is open; kept for the next time. */
export const coloring = remembered<Coloring>("seerob.coloring", COLORINGS, "parts");
export const palette = remembered<Palette>("seerob.palette", PALETTES, "green to red");
const chosenScore = signal<string | null>(null);

/** Whether this run has a rule that scores postures. */
export const hasScores = computed(() => scene.value?.criteria.some((c) => c.group === "ergonomics") ?? false);

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
  if (stale.value) return new Map();
  const result = frame.value?.results.find((r) => r.name === shownScore.value);
  return tints(result, coloring.value, palette.value);
});
