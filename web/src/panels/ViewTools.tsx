// Over the room: viewpoints, and what is drawn in it.

import { useSignal } from "@preact/signals";
import { mutedCriteria, scene, toggleMuted } from "../page_state";
import { showCaptions, showGrid } from "../scene/viewer";
import type { Preset } from "../scene/viewpoint";
import { useActions } from "./app_context";
import { Icon } from "./Icon";

const PRESETS: readonly [Preset, string][] = [
  ["corner", "3D"],
  ["front", "Front"],
  ["side", "Side"],
  ["top", "Top"],
  ["operator", "Operator"],
];

export function ViewTools() {
  const actions = useActions();
  const open = useSignal(false);
  const person = scene.value?.nodes.some((node) => node.role === "human" && /(^|[/_])head$/i.test(node.name));
  return (
    <div class="view-tools">
      <fieldset class="tools">
        <legend class="visually-hidden">Viewpoint</legend>
        {PRESETS.filter(([preset]) => preset !== "operator" || person).map(([preset, title]) => (
          <button key={preset} type="button" onClick={() => actions.look(preset)}>
            {title}
          </button>
        ))}
        <button
          type="button"
          title="Frame the selection (F)"
          aria-label="Frame the selection"
          onClick={() => actions.frameSelection()}
        >
          <Icon name="frame" />
        </button>
      </fieldset>
      <div class="tools overlays">
        <button
          type="button"
          aria-expanded={open.value}
          onClick={() => {
            open.value = !open.value;
          }}
        >
          <Icon name="layers" /> Overlays
        </button>
        {open.value && <OverlayList />}
      </div>
    </div>
  );
}

function OverlayList() {
  return (
    <div class="overlay-list">
      {scene.value?.criteria.map(({ name }, i) => (
        <label key={name}>
          <input
            type="checkbox"
            checked={!mutedCriteria.value.has(name)}
            onChange={() => toggleMuted(name)}
          />
          <span>{name}</span>
          {i < 9 && <kbd>{i + 1}</kbd>}
        </label>
      ))}
      <hr />
      <label>
        <input
          type="checkbox"
          checked={showCaptions.value}
          onChange={() => {
            showCaptions.value = !showCaptions.value;
          }}
        />
        <span>Labels of the worst three</span>
      </label>
      <label>
        <input
          type="checkbox"
          checked={showGrid.value}
          onChange={() => {
            showGrid.value = !showGrid.value;
          }}
        />
        <span>Floor grid</span>
      </label>
    </div>
  );
}
