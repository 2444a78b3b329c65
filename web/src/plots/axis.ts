// The one time axis of plots and lanes: what of the run they show, and where the cursor is.

import { computed, signal } from "@preact/signals";
import { besideTraces, isLive, lookingAt, now, reach, traces, tracesRevision } from "../page_state";
import { remembered } from "../remembered";

export interface TimeRange {
  start: number;
  end: number;
}

/** Widths of the axis. */
export const WIDTHS = ["10 s", "30 s", "2 min", "All"] as const;
export type Width = (typeof WIDTHS)[number];

const SECONDS: Record<Width, number | null> = { "10 s": 10, "30 s": 30, "2 min": 120, All: null };
/** A live run's axis shows at least so much [s], so that it does not race at the start. */
const LIVE_LEAST_S = 60;

export const width = remembered<Width>("seerob.axis", WIDTHS, "All");

/** What the axis shows while somebody drags on it: it must not run away below the pointer. */
export const held = signal<TimeRange | null>(null);

// While somebody looks back at a live run its axis stands still: it must not run away below the pointer.
const stopped = signal<{ range: TimeRange; width: Width } | null>(null);

/** Stop the axis of a live run where it is, or with `t` [s] in its middle when that lies outside. */
export function stopAxis(t: number): void {
  let { start, end } = shownRange();
  if (t < start || t > end) {
    const span = end - start;
    start = Math.max(t - span / 2, firstTime.value);
    end = start + span;
  }
  stopped.value = { range: { start, end }, width: width.value };
}

/** Choose how wide the axis is. */
export function setWidth(chosen: Width): void {
  width.value = chosen;
  if (lookingAt.value !== null) stopAxis(lookingAt.value);
}

/** What is shown; read inside a component or an effect, it is kept up to date. */
export function shownRange(): TimeRange {
  if (held.value) return held.value;
  if (lookingAt.value !== null && stopped.value?.width === width.value) return stopped.value.range;
  const seconds = SECONDS[width.value];
  const { start, end } = reach.value;
  if (isLive.value) {
    const first = firstTime.value;
    const span = seconds ?? Math.max(end - first, LIVE_LEAST_S);
    const last = Math.max(end, first + span);
    return range(last - span, last);
  }
  if (seconds === null || seconds >= end - start) {
    // All of a longer run beside it is seen, too.
    const { first, last } = beside.value;
    const begin = Math.min(start, first);
    const stop = seconds === null ? last : Math.min(last, begin + seconds);
    return range(begin, Math.max(end, stop, begin + 1e-3));
  }
  const middle = Number.isFinite(now.value) ? now.value : start;
  const left = Math.min(Math.max(middle - seconds / 2, start), end - seconds);
  return range(left, left + seconds);
}

let newest: TimeRange = { start: 0, end: 0 };

// The same one as long as it is the same: it is asked for with every picture.
function range(start: number, end: number): TimeRange {
  if (newest.start !== start || newest.end !== end) newest = { start, end };
  return newest;
}

const beside = computed(() => {
  void tracesRevision.value;
  let [first, last] = [Number.POSITIVE_INFINITY, Number.NEGATIVE_INFINITY];
  for (const { t, length } of besideTraces.values()) {
    if (length === 0) continue;
    first = Math.min(first, t[0]!);
    last = Math.max(last, t[length - 1]!);
  }
  return { first, last };
});

// A page that came late was told what happened before.
const firstTime = computed(() => {
  void tracesRevision.value;
  let first = Number.POSITIVE_INFINITY;
  for (const trace of traces.values()) if (trace.length > 0) first = Math.min(first, trace.t[0]!);
  return Number.isFinite(first) ? first : 0;
});

/** Run time at a share of the axis [s]. */
export function timeAt({ start, end }: TimeRange, share: number): number {
  return start + Math.min(1, Math.max(0, share)) * (end - start);
}
