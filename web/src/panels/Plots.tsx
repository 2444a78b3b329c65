// A few criteria over time, side by side, under one time cursor.

import { effect, signal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import { against, steady, withUnit } from "../figures";
import {
  isLive,
  lookingAt,
  now,
  type Row,
  reach,
  rows,
  scene,
  select,
  selection,
  stale,
  traces,
  tracesRevision,
} from "../page_state";
import { Chart, type ChartView } from "../plots/chart";
import { ranked } from "../plots/ranking";
import { redrawEveryMs } from "../scene/effort";
import { useActions } from "./app_context";
import { StateBadge } from "./StateBadge";

/** Widths of the time window [s]; null for the whole recording. */
const WINDOWS: readonly [number | null, string][] = [
  [10, "10 s"],
  [30, "30 s"],
  [120, "2 min"],
  [null, "All"],
];

const chosenWindow = signal<number | null | undefined>(undefined);

function windowWidth(): number | null {
  const chosen = chosenWindow.value;
  return chosen === undefined ? (isLive.value ? 30 : null) : chosen;
}

export function Plots({ count }: { count: number }) {
  const names = plotted(count);
  return (
    <section class="plots" aria-label="Plots">
      <fieldset class="windows">
        <legend class="visually-hidden">Time window</legend>
        {WINDOWS.map(([seconds, title]) => (
          <button
            key={title}
            type="button"
            aria-pressed={windowWidth() === seconds}
            class={windowWidth() === seconds ? "on" : ""}
            onClick={() => {
              chosenWindow.value = seconds;
            }}
          >
            {title}
          </button>
        ))}
      </fieldset>
      <div class="charts">
        {names.map((name) => (
          <Plot key={name} name={name} />
        ))}
      </div>
    </section>
  );
}

// The selected one is always among them.
function plotted(count: number): string[] {
  void tracesRevision.value;
  const all = ranked(scene.value?.criteria ?? []).map((criterion) => criterion.name);
  const names = all.slice(0, count);
  const chosen = selection.value?.kind === "criterion" ? selection.value.name : null;
  if (chosen && all.includes(chosen) && !names.includes(chosen)) names[names.length - 1] = chosen;
  return names;
}

function Plot({ name }: { name: string }) {
  const { time } = useActions();
  const place = useRef<HTMLDivElement>(null);
  useEffect(() => {
    const chart = new Chart(place.current!, (t) => time.seek(t));
    let timer: ReturnType<typeof setTimeout> | null = null;
    const draw = (): void => {
      timer = null;
      const trace = traces.get(name);
      if (trace) chart.show(trace, viewNow());
    };
    const stop = effect(() => {
      void [tracesRevision.value, now.value, chosenWindow.value, reach.value];
      timer ??= setTimeout(draw, redrawEveryMs());
    });
    return () => {
      stop();
      if (timer !== null) clearTimeout(timer);
      chart.dispose();
    };
  }, [name, time]);
  const row = rows.value.find((r) => r.info.name === name);
  const chosen = selection.value?.kind === "criterion" && selection.value.name === name;
  return (
    <figure class={`plot ${chosen ? "selected" : ""}`}>
      <figcaption class={stale.value ? "stale" : ""}>
        <button
          type="button"
          class="plot-name"
          title={name}
          onClick={() => select({ kind: "criterion", name })}
        >
          {name}
        </button>
        <span class="plot-value">{row && figureOf(row)}</span>
        {row && <StateBadge state={row.state} />}
      </figcaption>
      <div class="plot-area" ref={place} />
    </figure>
  );
}

function figureOf({ info, result }: Row): string {
  const { value } = against(result?.value ?? null, result?.limit ?? null, info.unit, info.at_most);
  return withUnit(steady(value, info.unit), info.unit);
}

// Live: the newest at the right edge. Looking back or replaying: the cursor in the middle, inside what there is.
function viewNow(): ChartView {
  const width = windowWidth();
  const at = now.peek();
  const { start, end } = reach.peek();
  if (isLive.peek()) {
    const first = firstTime();
    const span = width ?? Math.max(end - first, 10);
    const newest = Math.max(end, first + span);
    const right =
      lookingAt.peek() === null ? newest : Math.min(Math.max(at + span / 2, first + span), newest);
    return { start: right - span, end: right, now: at };
  }
  if (width === null || width >= end - start) return { start, end: Math.max(end, start + 1e-3), now: at };
  const left = Math.min(Math.max(at - width / 2, start), end - width);
  return { start: left, end: left + width, now: at };
}

function firstTime(): number {
  let first = Number.POSITIVE_INFINITY;
  for (const trace of traces.values()) if (trace.length > 0) first = Math.min(first, trace.t[0]!);
  return Number.isFinite(first) ? first : 0;
}
