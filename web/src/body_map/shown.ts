// What the body map shows now, on the page and on a board in the room: which limit, of which criterion, and where.

import { computed, signal } from "@preact/signals";
import { frame, rows } from "../page_state";
import { said } from "../words";
import { type Aspect, contactRows, dominantHand, leavesOpen, worst } from "./exposure";
import { spots } from "./figure";

export const aspect = signal<Aspect>("worst");
/** The criterion that is looked at alone; null for the worst of all. */
export const only = signal<string | null>(null);

export const contacts = computed(() => {
  const results = frame.value?.results ?? [];
  const sources = results.filter((result) => contactRows([result], null).length > 0).map((r) => r.name);
  const possible = rows.value.filter(({ info }) => info.kind === "power_and_force");
  const from = only.value !== null && sources.includes(only.value) ? only.value : null;
  const all = contactRows(results, from);
  const open = possible.find(({ info, result }) =>
    from === null || from === info.name ? !result || leavesOpen(result) : false,
  );
  return {
    /** Whether a criterion of this run judges contacts. */
    judged: possible.length > 0 || sources.length > 0,
    sources,
    from,
    all,
    /** Why nobody knows who can be hit, where no row says it; null where that is known. */
    open: open ? open.result?.reason || said("nothing was said about it in this snapshot") : null,
    spots: spots(dominantHand(all)),
    governing: worst(all, aspect.value),
  };
});
