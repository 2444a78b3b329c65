// One criterion over time: its value, its limit, and where the limit is exceeded or nothing can be said.

import uPlot from "uplot";
import { formatNumber, formatTime } from "../format";
import { colorOf } from "../theme";
import type { Trace } from "../traces";
import { hatchPattern } from "./hatch";
import { type PlotData, windowOf } from "./window";

const SYNC = "time";

export interface ChartView {
  start: number;
  end: number;
  now: number;
}

export class Chart {
  private readonly plot: uPlot;
  private view: ChartView = { start: 0, end: 1, now: Number.NaN };
  private trace: Trace | null = null;
  private beside: PlotData | null = null;
  private readonly resized: ResizeObserver;

  /** @param seek Called with the run time that was clicked [s]. */
  constructor(
    private readonly element: HTMLElement,
    seek: (t: number) => void,
  ) {
    this.plot = new uPlot(this.options(), [[], [], []], element);
    // uPlot's own cursor was placed at the last move, and a row that opened since may have moved the plot.
    this.plot.over.addEventListener("click", ({ clientX }) => {
      seek(this.plot.posToVal(clientX - this.plot.over.getBoundingClientRect().left, "x"));
    });
    this.resized = new ResizeObserver(() => this.fit());
    this.resized.observe(element);
  }

  /** @param beside Of another run, its values dashed, its limits dotted. */
  show(trace: Trace, view: ChartView, beside: Trace | null = null): void {
    this.view = view;
    this.trace = trace;
    const buckets = Math.max(100, this.element.clientWidth);
    this.beside = beside && windowOf(beside, view.start, view.end, buckets);
    const data = windowOf(trace, view.start, view.end, buckets);
    this.plot.setData(data, false);
    this.plot.batch(() => {
      this.plot.setScale("x", { min: view.start, max: view.end });
      this.plot.setScale("y", valueRange(...data.slice(1), ...(this.beside?.slice(1) ?? [])));
    });
  }

  dispose(): void {
    this.resized.disconnect();
    this.plot.destroy();
  }

  private fit(): void {
    const { clientWidth: width, clientHeight: height } = this.element;
    if (width > 0 && height > 0) this.plot.setSize({ width, height });
  }

  private options(): uPlot.Options {
    const axis = {
      stroke: () => colorOf("--text-3"),
      grid: { stroke: () => colorOf("--line-2"), width: 1 },
      ticks: { show: false },
      font: "11px system-ui",
    };
    return {
      width: Math.max(this.element.clientWidth, 50),
      height: Math.max(this.element.clientHeight, 50),
      pxAlign: 0,
      legend: { show: false },
      cursor: { sync: { key: SYNC }, drag: { x: false, y: false }, points: { size: 6 }, y: false },
      scales: { x: { time: false, auto: false }, y: { auto: false } },
      axes: [
        { ...axis, size: 22, gap: 2, values: (_, ticks) => ticks.map(shortTime) },
        {
          ...axis,
          size: 48,
          gap: 4,
          space: 26,
          values: (_, ticks) => ticks.map((y) => formatNumber(y, Math.max(...ticks.map(Math.abs)))),
        },
      ],
      series: [
        {},
        { stroke: () => colorOf("--curve"), width: 1.5, points: { show: false } },
        { stroke: () => colorOf("--exceeded-text"), width: 1.5, dash: [6, 4], points: { show: false } },
      ],
      hooks: {
        drawClear: [(plot) => this.shade(plot)],
        draw: [(plot) => this.other(plot), (plot) => this.cursor(plot)],
      },
    };
  }

  private shade(plot: uPlot): void {
    const { ctx, bbox } = plot;
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    for (const span of this.trace?.spans ?? []) {
      if (span.end < this.view.start || span.start > this.view.end) continue;
      const left = plot.valToPos(span.start, "x", true);
      const right = plot.valToPos(span.end, "x", true);
      ctx.globalAlpha = span.verdict === "exceeded" ? 0.38 : 0.3;
      ctx.fillStyle = span.verdict === "exceeded" ? "#c11540" : hatchPattern(ctx);
      ctx.fillRect(left, bbox.top, Math.max(right - left, 1), bbox.height);
    }
    ctx.restore();
  }

  private other(plot: uPlot): void {
    if (!this.beside) return;
    const [times, values, limits] = this.beside;
    const { ctx, bbox } = plot;
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    ctx.lineWidth = 1.5 * devicePixelRatio;
    for (const [column, color, dash] of [
      [limits, "--exceeded-text", [1, 4]],
      [values, "--accent", [4, 3]],
    ] as const) {
      ctx.beginPath();
      let drawn = false;
      column.forEach((value, i) => {
        if (value !== null) {
          const [x, y] = [plot.valToPos(times[i]!, "x", true), plot.valToPos(value, "y", true)];
          if (drawn) ctx.lineTo(x, y);
          else ctx.moveTo(x, y);
        }
        drawn = value !== null;
      });
      ctx.setLineDash(dash.map((px) => px * devicePixelRatio));
      ctx.strokeStyle = colorOf(color);
      ctx.stroke();
    }
    ctx.restore();
  }

  private cursor(plot: uPlot): void {
    const { now, start, end } = this.view;
    if (!(now >= start && now <= end)) return;
    const { ctx, bbox } = plot;
    ctx.save();
    ctx.fillStyle = colorOf("--cursor");
    ctx.fillRect(Math.round(plot.valToPos(now, "x", true)) - 1, bbox.top, 2, bbox.height);
    ctx.restore();
  }
}

function shortTime(t: number): string {
  return t >= 60 || t <= -60
    ? formatTime(t).replace(/\.?0+$/, "")
    : `${Number(t.toFixed(3))}`.replace("-", "−");
}

// Room for every value and for the limit, with a little air.
function valueRange(...columns: (number | null)[][]): { min: number; max: number } {
  let min = Number.POSITIVE_INFINITY;
  let max = Number.NEGATIVE_INFINITY;
  for (const column of columns) {
    for (let k = 0; k < column.length; k += 1) {
      const x = column[k]!;
      if (x === null) continue;
      if (x < min) min = x;
      if (x > max) max = x;
    }
  }
  if (min > max) return { min: 0, max: 1 };
  const air = 0.08 * (max - min) || 0.5 * Math.abs(max) || 0.5;
  return { min: min >= 0 ? Math.max(0, min - air) : min - air, max: max + air };
}
