// Painting of the timeline's lanes.

import { traces } from "../page_state";
import { paintedBy } from "../scene/effort";
import { colorOf } from "../theme";
import { VERDICT_COLORS } from "../verdicts";
import type { TimeRange } from "./axis";
import { hatchPattern } from "./hatch";

export const LANE_PX = 15;

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
  names.forEach((name, lane) => {
    const top = lane * LANE_PX + 2;
    const tall = LANE_PX - 4;
    brush.fillStyle = colorOf("--lane");
    brush.fillRect(0, top, width, tall);
    const trace = traces.get(name);
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
