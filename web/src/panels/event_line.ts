// One event in a line, for the list on the page and for the panel in the room.

import { spoken } from "../units";
import type { Event } from "../wire";
import { said, word } from "../words";

const WORDS: Record<string, string> = {
  taken: word("taken"),
  handed: word("handed over"),
  torn: word("torn out"),
  placed: word("placed"),
  dropped: word("dropped"),
  refused: word("not taken"),
  round: word("round ended"),
  filled: word("filled"),
};

/** `12.31 s  blank placed in box after 2.4 s`. */
export function eventLine({ t, what, piece, by, where, took, reason }: Event): string {
  const place = where
    ? ` ${said(what === "taken" ? word("from {place}") : word("in {place}"), { place: where })}`
    : "";
  const time = typeof took === "number" ? `${took.toFixed(1)} s` : "";
  const long = time && (what === "round" ? `: ${time}` : ` ${said("after {time}", { time })}`);
  const who = by && what !== "round" ? ` (${by})` : "";
  return `${t.toFixed(2)} s  ${piece} ${said(WORDS[what] ?? what)}${place}${long}${who}${reason ? `: ${spoken(reason)}` : ""}`;
}

/** Boxes that were filled, and how long rounds took, of all that happened so far. */
export function eventFigures(events: readonly Event[]): string[] {
  const found = [];
  const filled = events.findLast(({ what }) => what === "filled");
  if (filled) found.push(said("{n} boxes or other places filled.", { n: filled.count ?? 0 }));
  const rounds = events.filter(({ what }) => what === "round").map(({ took }) => took ?? 0);
  if (rounds.length > 0)
    found.push(
      said("{n} rounds: {mean} s each on average, {least} to {most} s.", {
        n: rounds.length,
        mean: (rounds.reduce((a, b) => a + b) / rounds.length).toFixed(2),
        least: Math.min(...rounds).toFixed(2),
        most: Math.max(...rounds).toFixed(2),
      }),
    );
  return found;
}
