// Over the room: viewpoints, and what is drawn in it.

import { useSignal } from "@preact/signals";
import { mayEdit } from "../editing/draft";
import { measuring, toggleMeasure } from "../editing/measure";
import { scene } from "../page_state";
import type { Preset } from "../scene/viewpoint";
import { useActions } from "./app_context";
import { Icon } from "./Icon";
import { OverlayList } from "./OverlayList";

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
      {mayEdit.value && (
        <div class="tools">
          <button
            type="button"
            title="Distance of two surfaces (D); Escape ends it"
            aria-pressed={measuring.value !== null}
            onClick={toggleMeasure}
          >
            Measure
          </button>
        </div>
      )}
      <fieldset
        class="tools overlays"
        onKeyDown={(event) => {
          if (event.key !== "Escape" || !open.value) return;
          open.value = false;
          event.currentTarget.querySelector("button")?.focus();
          event.stopPropagation();
        }}
      >
        <legend class="visually-hidden">Overlays</legend>
        <button
          type="button"
          title="What is drawn by which criterion (1 to 9)"
          aria-expanded={open.value}
          aria-controls="overlays"
          onClick={() => {
            open.value = !open.value;
          }}
        >
          <Icon name="layers" /> Overlays
        </button>
        {open.value && <OverlayList />}
      </fieldset>
    </div>
  );
}
