// What the body map shows now, on the page and on a board in the room: which limit, of which criterion, and where.

import { computed, signal } from "@preact/signals";
import { frame, scene } from "../page_state";
import { type Aspect, contactRows, dominantHand, worst } from "./exposure";
import { spots } from "./figure";

export const aspect = signal<Aspect>("worst");
/** The criterion that is looked at alone; null for the worst of all. */
export const only = signal<string | null>(null);

export const contacts = computed(() => {
  const results = frame.value?.results ?? [];
  const sources = results.filter((result) => contactRows([result], null).length > 0).map((r) => r.name);
  const possible = scene.value?.criteria.filter((c) => c.kind === "power_and_force").map((c) => c.name) ?? [];
  const from = only.value !== null && sources.includes(only.value) ? only.value : null;
  const all = contactRows(results, from);
  return {
    /** Whether a criterion of this run judges contacts. */
    judged: possible.length > 0 || sources.length > 0,
    sources,
    from,
    all,
    spots: spots(dominantHand(all)),
    governing: worst(all, aspect.value),
  };
});
