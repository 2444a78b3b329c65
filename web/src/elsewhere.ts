// What a whole recording holds that is worse than the instant on screen.

import type { Span, Trace } from "./traces";
import type { State } from "./verdicts";

export interface Elsewhere {
  verdict: Span["verdict"];
  /** Criteria that have it at some other time, in the order of the traces. */
  criteria: readonly string[];
}

/** The worst verdict of the traces where it is worse than what is shown; null where it is not. */
export function worseElsewhere(traces: Iterable<Trace>, shown: State): Elsewhere | null {
  if (shown === "exceeded") return null;
  const all = [...traces];
  const undecided = shown === "undecided" || shown === "missing";
  for (const verdict of undecided ? (["exceeded"] as const) : (["exceeded", "undecided"] as const)) {
    const criteria = all.filter((trace) => trace.spans.some((span) => span.verdict === verdict));
    if (criteria.length > 0) return { verdict, criteria: criteria.map((trace) => trace.name) };
  }
  return null;
}
