// Gathers one point per criterion and snapshot, so that plots miss nothing between two screen updates.

import type { TracePoints } from "./messages";
import type { Result, Snapshot, Verdict } from "./wire";

/** The byte that stands for a verdict in traces. */
export const VERDICT_CODES = { within: 0, exceeded: 1, undecided: 2 } as const satisfies Record<
  Verdict,
  number
>;
/** And back. */
export const VERDICT_OF: Partial<Record<number, Verdict>> = { 0: "within", 1: "exceeded", 2: "undecided" };
export const NO_VERDICT = 255;

interface Gathered {
  t: number[];
  values: number[];
  limits: number[];
  verdicts: number[];
}

/** Points since the last `take`. */
export class PointCollector {
  private gathered = new Map<string, Gathered>();
  private last = new Map<string, number>();

  clear(): void {
    this.gathered.clear();
    this.last.clear();
  }

  /** Add a snapshot's results; a result that was already heard (a criterion with a period) is not repeated. */
  add(snapshot: Snapshot): void {
    for (const result of snapshot.results) this.addResult(result, result.t ?? snapshot.t);
  }

  /** What was gathered; empties the collector. */
  take(): TracePoints[] {
    const points: TracePoints[] = [];
    for (const [name, g] of this.gathered) {
      points.push({
        name,
        t: Float64Array.from(g.t),
        values: Float64Array.from(g.values),
        limits: Float64Array.from(g.limits),
        verdicts: Uint8Array.from(g.verdicts),
      });
    }
    this.gathered.clear();
    return points;
  }

  private addResult(result: Result, t: number): void {
    if (t <= (this.last.get(result.name) ?? Number.NEGATIVE_INFINITY)) return;
    this.last.set(result.name, t);
    let g = this.gathered.get(result.name);
    if (!g) {
      g = { t: [], values: [], limits: [], verdicts: [] };
      this.gathered.set(result.name, g);
    }
    g.t.push(t);
    g.values.push(result.value ?? Number.NaN);
    g.limits.push(result.limit ?? Number.NaN);
    g.verdicts.push(result.verdict === null ? NO_VERDICT : VERDICT_CODES[result.verdict]);
  }
}
