// What a verdict is called, looks like and ranks. Three colours that stay apart in every colour vision,
// and always an icon and a word beside them.

import type { Result, Verdict } from "./wire";
import { word } from "./words";

/** How a row, a body or the whole is shown. `none` informs; `missing` is a limit that nobody judged. */
export type State = "exceeded" | "undecided" | "missing" | "close" | "within" | "none";

/** Share of the limit under which a value within it is said to be close. Only a hint to the eye. */
export const CLOSE_MARGIN = 0.1;

export const STATE_WORDS: Record<State, string> = {
  exceeded: word("exceeded"),
  undecided: word("undecided"),
  missing: word("no result"),
  close: word("within, close"),
  within: word("within"),
  none: word("informs"),
};

export const STATE_ICONS: Record<State, string> = {
  exceeded: "✕",
  undecided: "?",
  missing: "?",
  close: "!",
  within: "✓",
  none: "·",
};

/** Worst first. */
export const STATE_ORDER: readonly State[] = ["exceeded", "undecided", "missing", "close", "within", "none"];

/** Fill colours in the scene and on canvases, sRGB. */
export const VERDICT_COLORS: Record<Verdict, number> = {
  within: 0x14aab8,
  exceeded: 0xc11540,
  undecided: 0xfcea92,
};

/** Text colours, at least 4.5:1 on the page's dark surfaces. */
export const VERDICT_TEXT: Record<Verdict, string> = {
  within: "#7ee7f1",
  exceeded: "#ff8fa6",
  undecided: "#fbe36a",
};

/** Colour of a marker that has no verdict. */
export const NEUTRAL_COLOR = 0xaab6c6;
/** Colour of a body that may be elsewhere. */
export const DOUBT_COLOR = 0x8a94a3;
export const NEUTRAL_TEXT = "#dbe3ee";

/** Distance to the limit on the admissible side, as a share of the limit; null when it cannot be had. */
export function margin(result: Pick<Result, "value" | "limit" | "at_most">): number | null {
  const { value, limit, at_most } = result;
  if (value === null || limit === null || limit === 0) return null;
  return (at_most ? limit - value : value - limit) / Math.abs(limit);
}

/** How one result is shown. */
export function stateOf(result: Pick<Result, "value" | "limit" | "at_most" | "verdict">): State {
  ALONE[0] = result.value ?? Number.NaN;
  ALONE[1] = result.limit ?? Number.NaN;
  return stateAt(result.verdict, result.at_most, ALONE, 0, 1);
}

const ALONE = new Float64Array(2);

/**
 * The same of figures that stand among others; NaN for none.
 *
 * It is asked for with every picture, and a number that is handed over by itself would be an object each time.
 *
 * @param value Where in `numbers` the value stands; −1 for none.
 * @param limit Where in them the limit stands; −1 for none.
 */
export function stateAt(
  verdict: Result["verdict"],
  atMost: Result["at_most"],
  numbers: Float64Array,
  value: number,
  limit: number,
): State {
  if (verdict === "exceeded" || verdict === "undecided") return verdict;
  if (verdict !== "within") return "none";
  if (value < 0 || limit < 0) return "within";
  const most = numbers[limit]!;
  const left = (atMost ? most - numbers[value]! : numbers[value]! - most) / Math.abs(most);
  return most !== 0 && left < CLOSE_MARGIN ? "close" : "within";
}

/** The worst of several states; `none` for none. */
export function worstState(states: Iterable<State>): State {
  let best = STATE_ORDER.length - 1;
  for (const state of states) best = Math.min(best, STATE_ORDER.indexOf(state));
  return STATE_ORDER[best]!;
}
