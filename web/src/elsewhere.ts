// What a run holds that is worse than the instant on screen: a recording at any time, a live run so far.

import type { Span, Trace } from "./traces";
import type { State } from "./verdicts";
import { said } from "./words";

export interface Elsewhere {
  verdict: Span["verdict"];
  /** Criteria that have it at some other time, in the order of the traces. */
  criteria: readonly string[];
  /** The one that had it last, and until when [s]. */
  latest: { name: string; end: number };
}

/** The worst verdict of the traces where it is worse than what is shown; null where it is not. */
export function worseElsewhere(traces: Iterable<Trace>, shown: State): Elsewhere | null {
  if (shown === "exceeded") return null;
  const all = [...traces];
  const undecided = shown === "undecided" || shown === "missing";
  for (const verdict of undecided ? (["exceeded"] as const) : (["exceeded", "undecided"] as const)) {
    const found = all.flatMap((trace) => {
      const span = trace.spans.findLast((s) => s.verdict === verdict);
      return span ? [{ name: trace.name, end: span.end }] : [];
    });
    if (found.length === 0) continue;
    const latest = found.reduce((a, b) => (b.end > a.end ? b : a));
    return { verdict, criteria: found.map(({ name }) => name), latest };
  }
  return null;
}

/** How long ago, in words that a glance takes in. */
export function ago(seconds: number): string {
  if (seconds < 1) return said("just now");
  if (seconds < 90) return said("{n} s ago", { n: Math.floor(seconds) });
  if (seconds < 5400) return said("{n} min ago", { n: Math.floor(seconds / 60) });
  return said("{n} h ago", { n: Math.floor(seconds / 3600) });
}
