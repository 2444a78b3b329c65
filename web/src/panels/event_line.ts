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
