// The stretch of a trace that a plot shows, with as many points as it has room for and every extremum.

import type { Trace } from "../traces";

export type Column = (number | null)[];

/** Columns of uPlot: run time, value, limit. */
export type PlotData = [number[], Column, Column];

/**
 * Points of a trace between two instants.
 *
 * @param buckets Largest number of stretches; of each the lowest and the highest value are kept.
 */
export function windowOf(trace: Trace, start: number, end: number, buckets: number): PlotData {
  const data: PlotData = [[], [], []];
  const first = Math.max(0, trace.indexAt(start) - 1);
  const last = Math.min(trace.length, trace.indexAt(end) + 1);
  const stride = Math.max(1, Math.ceil((last - first) / buckets));
  for (let from = first; from < last; from += stride) {
    const to = Math.min(from + stride, last);
    let low = from;
    let high = from;
    let gap = -1;
    for (let i = from; i < to; i += 1) {
      const value = trace.values[i]!;
      if (Number.isNaN(value)) gap = i;
      else if (value < trace.values[low]! || Number.isNaN(trace.values[low]!)) low = i;
      if (value > trace.values[high]! || Number.isNaN(trace.values[high]!)) high = i;
    }
    const first = Math.min(low, high);
    const second = Math.max(low, high);
    const gaps = gap >= 0 && gap !== low && gap !== high;
    if (gaps && gap < first) push(data, trace, gap);
    push(data, trace, first);
    if (gaps && gap > first && gap < second) push(data, trace, gap);
    if (second !== first) push(data, trace, second);
    if (gaps && gap > second) push(data, trace, gap);
  }
  return data;
}

function push(data: PlotData, trace: Trace, i: number): void {
  data[0].push(trace.t[i]!);
  data[1].push(known(trace.values[i]!));
  data[2].push(known(trace.limits[i]!));
}

function known(x: number): number | null {
  return Number.isNaN(x) ? null : x;
}
