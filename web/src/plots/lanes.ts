// Painting of the timeline's lanes; those of another run lie below, narrower and paler.

import { untracked } from "@preact/signals";
import { besideTitle, besideTraces, traces } from "../page_state";
import { paintedBy } from "../scene/effort";
import { colorOf } from "../theme";
import type { Trace } from "../traces";
import { VERDICT_COLORS } from "../verdicts";
import type { TimeRange } from "./axis";
import { hatchPattern } from "./hatch";

const LANE_PX = 15;
/** Of another run, below. */
const BESIDE_PX = 6;
/** How much paler that one is. */
const PALER = 0.6;

/** Height of a lane [px]; read inside a component or an effect, it is kept up to date. */
export function lanePx(): number {
  return besideTitle.value === "" ? LANE_PX : LANE_PX + BESIDE_PX + 1;
}

export function drawLanes(
  canvas: HTMLCanvasElement,
  names: readonly string[],
  range: TimeRange,
  now: number,
  stale: boolean,
): void {
  const ratio = globalThis.devicePixelRatio;
  const width = canvas.clientWidth;
  const height = canvas.clientHeight;
  canvas.width = Math.round(width * ratio);
  canvas.height = Math.round(height * ratio);
  const brush = canvas.getContext("2d", paintedBy())!;
  brush.scale(ratio, ratio);
  brush.globalAlpha = stale ? 0.4 : 1;
  const x = (t: number): number => ((t - range.start) / (range.end - range.start)) * width;
  const paint = (trace: Trace | undefined, top: number, tall: number): void => {
    brush.fillStyle = colorOf("--lane");
    brush.fillRect(0, top, width, tall);
    if (!trace || trace.length === 0) return;
    const from = Math.max(0, x(trace.t[0]!));
    // What never was within only informs: it is grey where nothing was undecided.
    brush.fillStyle = colorOf(trace.kept ? "--lane-within" : "--lane-none");
    brush.fillRect(from, top, Math.min(width, x(trace.t[trace.length - 1]!)) - from, tall);
    for (const verdict of ["undecided", "exceeded"] as const) {
      brush.fillStyle = verdict === "exceeded" ? css(VERDICT_COLORS.exceeded) : hatchPattern(brush);
      for (const span of trace.spans) {
        if (span.verdict !== verdict || span.end < range.start || span.start > range.end) continue;
        const left = x(span.start);
        // An instant must be seen too: never narrower than two pixels.
        brush.fillRect(left, top, Math.max(x(span.end) - left, 2), tall);
      }
    }
  };
  const each = untracked(lanePx);
  names.forEach((name, lane) => {
    const top = lane * each + 2;
    paint(traces.get(name), top, LANE_PX - 4);
    if (each === LANE_PX) return;
    const before = brush.globalAlpha;
    brush.globalAlpha = before * PALER;
    paint(besideTraces.get(name), top + LANE_PX - 3, BESIDE_PX);
    brush.globalAlpha = before;
  });
  brush.globalAlpha = 1;
  if (Number.isFinite(now)) {
    brush.fillStyle = colorOf("--cursor");
    brush.fillRect(Math.round(x(now)) - 1, 0, 2, height);
  }
}

function css(color: number): string {
  return `#${color.toString(16).padStart(6, "0")}`;
}
