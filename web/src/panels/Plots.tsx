// A few criteria over time, side by side, under one time cursor.

import { untracked } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import { against, steady, withUnit } from "../figures";
import { formatTime } from "../format";
import {
  besideRefusal,
  besideTitle,
  besideTraces,
  clock,
  mayControl,
  now,
  otherRuns,
  type Row,
  rows,
  scene,
  select,
  selection,
  stale,
  traces,
  tracesRevision,
} from "../page_state";
import { setWidth, shownRange, WIDTHS, width } from "../plots/axis";
import { Chart } from "../plots/chart";
import { ranked } from "../plots/ranking";
import { redrawn } from "../plots/redrawn";
import { VERDICT_OF } from "../points";
import { theme } from "../theme";
import { spoken } from "../units";
import { stateOf } from "../verdicts";
import { said } from "../words";
import { useActions } from "./app_context";
import { StateBadge } from "./StateBadge";

export function Plots({ count }: { count: number }) {
  const names = plotted(count);
  return (
    <section class="plots" aria-label={said("Plots")}>
      <fieldset class="windows">
        <legend class="visually-hidden">{said("Time window")}</legend>
        {WIDTHS.map((title) => (
          <button
            key={title}
            type="button"
            aria-pressed={width.value === title}
            class={width.value === title ? "on" : ""}
            onClick={() => setWidth(title)}
          >
            {title === "All" ? said("All") : title}
          </button>
        ))}
      </fieldset>
      <OtherRun />
      <div class="charts">
        {names.map((name) => (
          <Plot key={name} name={name} />
        ))}
      </div>
    </section>
  );
}

// Which run is beside this one: all pages of a replay see the same.
function OtherRun() {
  const { time } = useActions();
  const [title, refusal, offered] = [besideTitle.value, besideRefusal.value, otherRuns.value];
  if (title === "" && refusal === "" && offered.length === 0) return null;
  return (
    <div class="beside">
      {offered.length > 0 && (
        <label>
          {said("Another run")}{" "}
          <select
            value={offered.indexOf(title)}
            disabled={!mayControl.value}
            onChange={(event) => time.beside(Number(event.currentTarget.value))}
          >
            <option value={-1}>–</option>
            {offered.map((one, k) => (
              <option key={one} value={k}>
                {one}
              </option>
            ))}
          </select>
        </label>
      )}
      {title !== "" && <p>{said("below, and dashed: {title}, as it was recorded", { title })}</p>}
      {refusal !== "" && <p role="alert">{spoken(refusal)}</p>}
    </div>
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
    const draw = (): void => {
      const trace = traces.get(name);
      if (trace)
        chart.show(trace, { ...untracked(shownRange), now: now.peek() }, besideTraces.get(name) ?? null);
    };
    const stop = redrawn(() => [tracesRevision.value, now.value, shownRange(), theme.value], draw);
    return () => {
      stop();
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
      {besideTitle.value !== "" && <Beside name={name} row={row} />}
      <div class="plot-area" ref={place} />
    </figure>
  );
}

/** What the other run had is told with its time when that is longer ago [s]. */
const LATE_S = 0.05;

// What the other run had at the cursor, in its own words; nothing where it had none.
function Beside({ name, row }: { name: string; row: Row | undefined }) {
  void tracesRevision.value;
  const trace = besideTraces.get(name);
  const i = trace?.indexHolding(clock.value) ?? -1;
  const shown = row && trace && i >= 0;
  const [value, limit] = shown ? [trace.values[i]!, trace.limits[i]!].map(given) : [null, null];
  const verdict = shown ? VERDICT_OF[trace.verdicts[i]!] : undefined;
  const unit = row?.info.unit ?? "";
  const at_most = row?.info.at_most ?? true;
  return (
    <p class="plot-beside" title={besideTitle.value}>
      <i aria-hidden="true" />
      <span class="plot-beside-title">{besideTitle.value}</span>
      <span class="plot-value">
        {shown
          ? withUnit(steady(against(value!, limit!, unit, at_most).value, unit), unit)
          : said("nothing at this time")}
        {shown &&
          clock.value - trace.t[i]! > LATE_S &&
          ` ${said("at {time}", { time: formatTime(trace.t[i]!) })}`}
      </span>
      {shown && (
        <StateBadge state={stateOf({ value: value!, limit: limit!, at_most, verdict: verdict ?? null })} />
      )}
    </p>
  );
}

const given = (x: number): number | null => (Number.isNaN(x) ? null : x);

function figureOf({ info, result }: Row): string {
  const { value } = against(result?.value ?? null, result?.limit ?? null, info.unit, info.at_most);
  return withUnit(steady(value, info.unit), info.unit);
}
