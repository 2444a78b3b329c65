// One event in a line, for the list on the page and for the panel in the room.

import type { Event } from "../wire";

const WORDS: Record<string, string> = {
  taken: "taken",
  handed: "handed over",
  torn: "torn out",
  placed: "placed",
  dropped: "dropped",
  refused: "not taken",
  round: "round ended",
};

/** `12.31 s  blank placed in box after 2.4 s`. */
export function eventLine({ t, what, piece, by, where, took, reason }: Event): string {
  const place = where ? ` ${what === "taken" ? "from" : "in"} ${where}` : "";
  const long = typeof took === "number" ? `${what === "round" ? ":" : " after"} ${took.toFixed(1)} s` : "";
  const who = by && what !== "round" ? ` (${by})` : "";
  return `${t.toFixed(2)} s  ${piece} ${WORDS[what] ?? what}${place}${long}${who}${reason ? `: ${reason}` : ""}`;
}
