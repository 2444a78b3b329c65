// One criterion over time: what the plots draw and the timeline's lanes colour.

import type { TracePoints } from "./messages";
import { NO_VERDICT, VERDICT_CODES } from "./points";
import type { Trace as WireTrace } from "./wire";

/** A stretch of time in which a limit was exceeded or nothing could be said. */
export interface Span {
  start: number;
  end: number;
  verdict: "exceeded" | "undecided";
}

/** A pause longer than this ends a span: nobody knows what happened in between [s]. */
const SILENCE_S = 1;

const SPAN_VERDICTS = new Map<number, Span["verdict"]>([
  [VERDICT_CODES.exceeded, "exceeded"],
  [VERDICT_CODES.undecided, "undecided"],
]);

export class Trace {
  t: Float64Array;
  values: Float64Array;
  limits: Float64Array;
  verdicts: Uint8Array;
  length = 0;
  spans: Span[] = [];
  /** Whether there ever was a verdict: what only informs needs no lane. */
  judged = false;
  /** Whether there ever was a limit. */
  limited = false;
  /** Whether it was ever said to be within. */
  kept = false;
  /** Whether the limit was ever exceeded. */
  exceeded = false;

  /** @param capacity Points kept before the older ones are thinned. */
  constructor(
    readonly name: string,
    private readonly capacity = 40_000,
  ) {
    this.t = new Float64Array(1024);
    this.values = new Float64Array(1024);
    this.limits = new Float64Array(1024);
    this.verdicts = new Uint8Array(1024);
  }

  /** Index of the point that holds at `t`: the last at or before it; -1 before the first and after the last. */
  indexHolding(t: number): number {
    if (this.length === 0 || t > this.t[this.length - 1]!) return -1;
    const i = this.indexAt(t);
    return this.t[i] === t ? i : i - 1;
  }

  /** Add points that follow in time; earlier ones are left out. */
  append(points: TracePoints): void {
    for (let i = 0; i < points.t.length; i += 1) {
      this.push(points.t[i]!, points.values[i]!, points.limits[i]!, points.verdicts[i]!);
    }
  }

  /** Index of the first point at or after `t`; `length` when there is none. */
  indexAt(t: number): number {
    let low = 0;
    let high = this.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.t[middle]! < t) low = middle + 1;
      else high = middle;
    }
    return low;
  }

  private push(t: number, value: number, limit: number, verdict: number): void {
    if (this.length > 0 && t <= this.t[this.length - 1]!) return;
    if (this.length >= this.capacity) this.thin();
    if (this.length === this.t.length) this.grow();
    const i = this.length;
    this.t[i] = t;
    this.values[i] = value;
    this.limits[i] = limit;
    this.verdicts[i] = verdict;
    this.length += 1;
    this.judged ||= verdict !== NO_VERDICT;
    this.limited ||= !Number.isNaN(limit);
    this.kept ||= verdict === VERDICT_CODES.within;
    this.exceeded ||= verdict === VERDICT_CODES.exceeded;
    this.extendSpans(i);
  }

  // A verdict holds from its point to the next one.
  private extendSpans(i: number): void {
    const t = this.t[i]!;
    const last = this.spans[this.spans.length - 1];
    if (last && i > 0 && last.end === this.t[i - 1]! && t - last.end <= SILENCE_S) {
      const before = SPAN_VERDICTS.get(this.verdicts[i - 1]!);
      if (before === last.verdict) last.end = t;
    }
    const verdict = SPAN_VERDICTS.get(this.verdicts[i]!);
    if (verdict && !(last && last.verdict === verdict && last.end === t)) {
      this.spans.push({ start: t, end: t, verdict });
    }
  }

  // Of every four points of the older half, keep the lowest and the highest, and any change of verdict.
  private thin(): void {
    const half = this.length >> 1;
    let to = 0;
    for (let from = 0; from < half; from += 4) {
      const end = Math.min(from + 4, half);
      let low = from;
      let high = from;
      for (let i = from; i < end; i += 1) {
        if (this.values[i]! < this.values[low]!) low = i;
        if (this.values[i]! > this.values[high]!) high = i;
      }
      for (let i = from; i < end; i += 1) {
        const changes = i > 0 && this.verdicts[i] !== this.verdicts[i - 1];
        if (i === low || i === high || changes) this.move(i, to++);
      }
    }
    for (let i = half; i < this.length; i += 1) this.move(i, to++);
    this.length = to;
  }

  private move(from: number, to: number): void {
    this.t[to] = this.t[from]!;
    this.values[to] = this.values[from]!;
    this.limits[to] = this.limits[from]!;
    this.verdicts[to] = this.verdicts[from]!;
  }

  private grow(): void {
    const size = this.t.length * 2;
    const copy = <T extends { set(a: T): void }>(next: T, now: T): T => {
      next.set(now);
      return next;
    };
    this.t = copy(new Float64Array(size), this.t);
    this.values = copy(new Float64Array(size), this.values);
    this.limits = copy(new Float64Array(size), this.limits);
    this.verdicts = copy(new Uint8Array(size), this.verdicts);
  }
}

/** A trace of the wire: bytes are copied because they are not aligned. */
export function traceFromWire(wire: WireTrace, capacity: number): Trace {
  const trace = new Trace(wire.name, capacity);
  trace.append({
    name: wire.name,
    t: new Float64Array(wire.t.slice().buffer),
    values: new Float64Array(wire.values.slice().buffer),
    limits: new Float64Array(wire.limits.slice().buffer),
    verdicts: wire.verdicts,
  });
  return trace;
}

/** Start of the next exceeded span after `t` (or the last before it) over all traces; null when none. */
export function neighbourViolation(traces: Iterable<Trace>, t: number, forward: boolean): number | null {
  let best: number | null = null;
  for (const trace of traces) {
    for (const span of trace.spans) {
      if (span.verdict !== "exceeded") continue;
      const ahead = forward ? span.start > t + 1e-6 : span.start < t - 1e-6;
      if (!ahead) continue;
      if (best === null || (forward ? span.start < best : span.start > best)) best = span.start;
    }
  }
  return best;
}
