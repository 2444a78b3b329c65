// How the room is looked at, and what is taken along of it.

import { signal, useSignal } from "@preact/signals";
import { outlinesOnly } from "../scene/viewer";
import type { EndFilm } from "../view/film";
import { figures, figuresTable, fileName, save } from "../view/handed_out";
import { folded, forgetView, PANELS, type Panel, toggleFolded, views } from "../view/kept";
import { mayMeasure } from "../view/measure";
import { probing, toggleProbe } from "../view/probe";
import { reaching, toggleReach } from "../view/reach";
import { SECTIONS, sectionAt, sectionAxis } from "../view/section";
import { said, word } from "../words";
import { useActions } from "./app_context";
import { Choice } from "./Choice";

const PANEL_NAMES: Record<Panel, string> = {
  left: word("Scene and properties"),
  right: word("Results"),
  bottom: word("Plots and time"),
};

/** Ends the clip that is taken, also where the panel was closed meanwhile. */
const stop = signal<EndFilm | null>(null);

export function ViewPanel() {
  const actions = useActions();
  const chosen = useSignal("");
  const clip = async (): Promise<void> => {
    if (!stop.value) {
      stop.value = await actions.film();
      return;
    }
    const end = stop.value;
    stop.value = null;
    const filmed = await end();
    save(filmed, fileName(filmed.type.includes("mp4") ? "mp4" : "webm"));
  };
  const text = (content: string, kind: string) => new Blob([content], { type: kind });
  return (
    <div class="view-panel" id="view-panel">
      <Choice name={said("Section")} choices={SECTIONS} chosen={sectionAxis} title={said} />
      {sectionAxis.value !== "no section" && (
        <label>
          {said("beyond")} {sectionAt.value.toFixed(2)} m
          <input
            type="range"
            min="-3"
            max="3"
            step="0.01"
            value={sectionAt.value}
            onInput={(event) => {
              sectionAt.value = event.currentTarget.valueAsNumber;
            }}
          />
        </label>
      )}
      <Tick title={said("Speed of a point")} on={probing.value} turn={toggleProbe} />
      {mayMeasure.value && (
        <Tick title={said("Reach of what is selected")} on={reaching.value !== null} turn={toggleReach} />
      )}
      <Tick
        title={said("Volumes as outlines")}
        on={outlinesOnly.value}
        turn={() => {
          outlinesOnly.value = !outlinesOnly.value;
        }}
      />
      <hr />
      {PANELS.map((panel) => (
        <Tick
          key={panel}
          title={said(PANEL_NAMES[panel])}
          on={!folded.value.includes(panel)}
          turn={() => toggleFolded(panel)}
        />
      ))}
      <hr />
      <div class="row-of-buttons">
        <select
          aria-label={said("Saved views")}
          value={chosen.value}
          onChange={(event) => {
            chosen.value = event.currentTarget.value;
            const view = views.value.find(({ name }) => name === chosen.value);
            if (view) actions.goTo(view);
          }}
        >
          <option value="">{said("Saved views")}</option>
          {views.value.map(({ name }) => (
            <option key={name} value={name}>
              {said("view {name}", { name })}
            </option>
          ))}
        </select>
        <button type="button" onClick={() => actions.keepView()}>
          {said("Save view")}
        </button>
        <button type="button" disabled={chosen.value === ""} onClick={() => forgetView(chosen.value)}>
          {said("Forget")}
        </button>
      </div>
      <hr />
      <div class="row-of-buttons">
        <button type="button" onClick={async () => save(await actions.picture(), fileName("png"))}>
          {said("Picture")}
        </button>
        <button type="button" aria-pressed={stop.value !== null} onClick={() => void clip()}>
          {said(stop.value ? word("End the clip") : word("Clip"))}
        </button>
        <button type="button" onClick={() => save(text(figuresTable(), "text/csv"), fileName("csv"))}>
          {said("Figures (CSV)")}
        </button>
        <button
          type="button"
          onClick={() => save(text(JSON.stringify(figures(), null, 1), "application/json"), fileName("json"))}
        >
          {said("Figures (JSON)")}
        </button>
      </div>
    </div>
  );
}

function Tick({ title, on, turn }: { title: string; on: boolean; turn: () => void }) {
  return (
    <label>
      <input type="checkbox" checked={on} onChange={turn} />
      <span class="overlay-name">{title}</span>
    </label>
  );
}
