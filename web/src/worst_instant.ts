// Where a criterion was at its worst, and what it said at any instant, from its trace.

import { VERDICT_CODES } from "./points";
import type { Trace } from "./traces";
import type { Verdict } from "./wire";

export interface Instant {
  t: number;
  /** NaN where there was none. */
  value: number;
  limit: number;
  /** 0 within, 1 exceeded, 2 undecided, 255 none. */
  verdict: number;
}

const VERDICTS: readonly Verdict[] = ["within", "exceeded", "undecided"];

/** Sooner than this after another instant is the same event [s]. */
const APART_S = 1;

const RANK = new Map<number, number>([
  [VERDICT_CODES.exceeded, 0],
  [VERDICT_CODES.undecided, 1],
  [VERDICT_CODES.within, 2],
]);

/**
 * The worst instants of a trace, worst first, each at least a second from the ones before it.
 *
 * As the evaluation ranks them: the verdict first, then the margin to the limit; without a limit the
 * extreme value. What has no verdict and no value is no instant.
 */
export function worstInstants(trace: Trace, atMost: boolean, count: number): Instant[] {
  const found: Instant[] = [];
  while (found.length < count) {
    const instant = worstApart(trace, atMost, found);
    if (!instant) break;
    found.push(instant);
  }
  return found;
}

function worstApart(trace: Trace, atMost: boolean, others: readonly Instant[]): Instant | null {
  let best = -1;
  let [bestRank, bestLeft] = [Number.POSITIVE_INFINITY, Number.POSITIVE_INFINITY];
  for (let i = 0; i < trace.length; i += 1) {
    if (Number.isNaN(trace.values[i]) && trace.verdicts[i] !== VERDICT_CODES.exceeded) continue;
    const [ownRank, ownLeft] = [rank(trace, i), left(trace, i, atMost)];
    if (ownRank > bestRank || (ownRank === bestRank && ownLeft >= bestLeft)) continue;
    if (others.some((other) => Math.abs(other.t - trace.t[i]!) < APART_S)) continue;
    [best, bestRank, bestLeft] = [i, ownRank, ownLeft];
  }
  return best < 0 ? null : pointAt(trace, best);
}

/** The worst instant with a verdict; null when it never had it. */
export function worstWith(trace: Trace, atMost: boolean, verdict: "exceeded" | "undecided"): Instant | null {
  const code = VERDICT_CODES[verdict];
  let best = -1;
  for (let i = 0; i < trace.length; i += 1) {
    if (trace.verdicts[i] !== code) continue;
    if (best < 0 || left(trace, i, atMost) < left(trace, best, atMost)) best = i;
  }
  return best < 0 ? null : pointAt(trace, best);
}

/** Verdict of an instant; null for none. */
export function verdictOf({ verdict }: Instant): Verdict | null {
  return VERDICTS.find((name) => VERDICT_CODES[name] === verdict) ?? null;
}

/** What held at an instant: the last point at or before it; null before the first. */
export function heldAt(trace: Trace, t: number): Instant | null {
  const next = trace.indexAt(t + 1e-6);
  return next === 0 ? null : pointAt(trace, next - 1);
}

function pointAt(trace: Trace, i: number): Instant {
  return {
    t: trace.t[i]!,
    value: trace.values[i]!,
    limit: trace.limits[i]!,
    verdict: trace.verdicts[i]!,
  };
}

function rank(trace: Trace, i: number): number {
  return RANK.get(trace.verdicts[i]!) ?? 3;
}

// An exceedance of unknown size counts as the largest, anything else of unknown size as the smallest.
function left(trace: Trace, i: number, atMost: boolean): number {
  const value = trace.values[i]!;
  if (Number.isNaN(value))
    return trace.verdicts[i] === VERDICT_CODES.exceeded ? Number.NEGATIVE_INFINITY : Number.POSITIVE_INFINITY;
  const limit = Number.isNaN(trace.limits[i]!) ? 0 : trace.limits[i]!;
  return atMost ? limit - value : value - limit;
}
