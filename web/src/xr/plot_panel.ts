// A panel in the room with the selected criterion over the last half minute, its limit, and what happened last.

import { now, rows, selection, soFar, traces } from "../page_state";
import { eventLine } from "../panels/event_line";
import { orderedRows } from "../row_order";
import { said } from "../words";
import { INK, Panel } from "./panel";

const PIXELS = { width: 1080, height: 640 };
const SPAN_S = 30;
const EVENTS = 4;
/** Of the curve, left, top, right and bottom [px]. */
const FRAME = { left: 110, top: 80, right: 1050, bottom: 410 };

export class PlotPanel extends Panel {
  constructor() {
    super(PIXELS);
  }

  /** Name of the criterion that is shown: the selected one, else the worst. */
  static shown(): string | null {
    const chosen = selection.peek();
    if (chosen?.kind === "criterion") return chosen.name;
    return orderedRows.peek()[0]?.info.name ?? null;
  }

  protected news(): boolean {
    return true; // time goes on
  }

  protected paint(): void {
    const name = PlotPanel.shown();
    const unit = rows.peek().find(({ info }) => info.name === name)?.info.unit ?? "";
    this.line(
      name ? `${name}${unit ? ` [${unit}]` : ""}` : said("no criterion"),
      28,
      52,
      "bold 38px sans-serif",
    );
    const trace = name === null ? undefined : traces.get(name);
    const end = now.peek();
    if (trace && Number.isFinite(end)) this.curve(trace, end);
    (soFar.peek()?.events ?? []).slice(-EVENTS).forEach((event, k) => {
      this.line(eventLine(event), 28, 480 + 44 * k, "32px sans-serif");
    });
  }

  private curve(
    trace: { t: Float64Array; values: Float64Array; limits: Float64Array; indexAt(t: number): number },
    end: number,
  ): void {
    const [first, last] = [trace.indexAt(end - SPAN_S), trace.indexAt(end + 1e-9)];
    let [low, high] = [Number.POSITIVE_INFINITY, Number.NEGATIVE_INFINITY];
    for (let i = first; i < last; i += 1)
      for (const v of [trace.values[i]!, trace.limits[i]!])
        if (Number.isFinite(v)) [low, high] = [Math.min(low, v), Math.max(high, v)];
    if (!(low <= high)) return;
    const room = 0.08 * (high - low || Math.abs(high) || 1);
    [low, high] = [low - room, high + room];
    const x = (t: number): number => FRAME.left + ((t - end + SPAN_S) / SPAN_S) * (FRAME.right - FRAME.left);
    const y = (v: number): number => FRAME.bottom - ((v - low) / (high - low)) * (FRAME.bottom - FRAME.top);
    const { brush } = this;
    brush.strokeStyle = "#46566b";
    brush.lineWidth = 2;
    brush.strokeRect(FRAME.left, FRAME.top, FRAME.right - FRAME.left, FRAME.bottom - FRAME.top);
    for (const v of [low + room, high - room]) this.line(v.toPrecision(3), 10, y(v) + 10, "28px sans-serif");
    for (const [of, color, dash] of [
      [trace.values, "#7ee7f1", []],
      [trace.limits, "#ff8fa6", [12, 8]],
    ] as const) {
      brush.strokeStyle = color;
      brush.lineWidth = 4;
      brush.setLineDash([...dash]);
      brush.beginPath();
      let broken = true;
      for (let i = first; i < last; i += 1) {
        const v = of[i]!;
        // What is not known is a gap, no line across it.
        if (!Number.isFinite(v)) broken = true;
        else if (broken) {
          brush.moveTo(x(trace.t[i]!), y(v));
          broken = false;
        } else brush.lineTo(x(trace.t[i]!), y(v));
      }
      brush.stroke();
    }
    brush.setLineDash([]);
  }

  private line(text: string, x: number, y: number, font: string): void {
    this.write(text, x, y, INK, font, PIXELS.width - x - 20);
  }
}
