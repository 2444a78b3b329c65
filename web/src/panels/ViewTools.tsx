// Over the room: viewpoints, and what is drawn in it.

import { useSignal } from "@preact/signals";
import { scene } from "../page_state";
import type { Preset } from "../scene/viewpoint";
import { cameraShown, cameras, showCamera } from "../view/camera";
import { mayMeasure, measuring, toggleMeasure } from "../view/measure";
import { said, word } from "../words";
import { useActions } from "./app_context";
import { Icon } from "./Icon";
import { OverlayList } from "./OverlayList";
import { ViewPanel } from "./ViewPanel";

const PRESETS: readonly [Preset, string][] = [
  ["corner", word("3D")],
  ["front", word("Front")],
  ["side", word("Side")],
  ["top", word("Top")],
  ["operator", word("Operator")],
];

export function ViewTools() {
  const actions = useActions();
  const open = useSignal(false);
  const viewing = useSignal(false);
  const person = scene.value?.nodes.some((node) => node.role === "human" && /(^|[/_])head$/i.test(node.name));
  return (
    <div class="view-tools">
      <fieldset class="tools">
        <legend class="visually-hidden">{said("Viewpoint")}</legend>
        {PRESETS.filter(([preset]) => preset !== "operator" || person).map(([preset, title]) => (
          <button
            key={preset}
            type="button"
            onClick={() => {
              cameraShown.value = null;
              actions.look(preset);
            }}
          >
            {said(title)}
          </button>
        ))}
        {cameras.value.map(({ name }, number) => (
          <button
            key={name}
            type="button"
            title={said("The twin over the picture of this camera")}
            aria-pressed={cameraShown.value === number}
            onClick={() => showCamera(number)}
          >
            {name}
          </button>
        ))}
        <button
          type="button"
          title={said("Frame the selection (F)")}
          aria-label={said("Frame the selection")}
          onClick={() => actions.frameSelection()}
        >
          <Icon name="frame" />
        </button>
      </fieldset>
      {mayMeasure.value && (
        <div class="tools">
          <button
            type="button"
            title={said("Distance of two surfaces (D); Escape ends it")}
            aria-pressed={measuring.value !== null}
            onClick={toggleMeasure}
          >
            {said("Measure")}
          </button>
        </div>
      )}
      <fieldset
        class="tools overlays"
        onKeyDown={(event) => {
          if (event.key !== "Escape" || !(open.value || viewing.value)) return;
          open.value = false;
          viewing.value = false;
          event.currentTarget.querySelector("button")?.focus();
          event.stopPropagation();
        }}
      >
        <legend class="visually-hidden">{said("Overlays")}</legend>
        <button
          type="button"
          title={said("What is drawn by which criterion (1 to 9)")}
          aria-expanded={open.value}
          aria-controls="overlays"
          onClick={() => {
            open.value = !open.value;
            viewing.value = false;
          }}
        >
          <Icon name="layers" /> {said("Overlays")}
        </button>
        {open.value && <OverlayList />}
        <button
          type="button"
          title={said("How the room is looked at, and what is taken along")}
          aria-expanded={viewing.value}
          aria-controls="view-panel"
          onClick={() => {
            viewing.value = !viewing.value;
            open.value = false;
          }}
        >
          {said("View")}
        </button>
        {viewing.value && <ViewPanel />}
      </fieldset>
    </div>
  );
}
