// The colours of the manikin: what they speak of, and from what to what they go.

import { coloring, palette } from "../posture/coloring";
import { COLORINGS, type Coloring, cssColor, PALETTES, type Palette, scaleColor } from "../posture/scores";
import { said, word } from "../words";

const TITLES: Record<Coloring, string> = {
  parts: word("Body parts"),
  overall: word("Overall"),
  verdict: word("Verdicts"),
};
const STEPS = [0, 0.25, 0.5, 0.75, 1];

export function ColoringChoice() {
  return (
    <fieldset class="choice">
      <legend>{said("Colour the manikin by")}</legend>
      {COLORINGS.map((key) => (
        <button
          key={key}
          type="button"
          aria-pressed={coloring.value === key}
          onClick={() => {
            coloring.value = key;
          }}
        >
          {said(TITLES[key])}
        </button>
      ))}
    </fieldset>
  );
}

/** The scale from the best to the worst score. */
export function ScaleBar() {
  return (
    <span class="scale" aria-hidden="true">
      {STEPS.map((share) => (
        <i key={share} style={{ background: cssColor(scaleColor(share, palette.value)) }} />
      ))}
    </span>
  );
}

export function PaletteChoice() {
  return (
    <label class="scale-choice">
      <span class="unit">{said("best")}</span>
      <ScaleBar />
      <span class="unit">{said("worst")}</span>
      <select
        aria-label={said("Colours from the best to the worst score")}
        value={palette.value}
        onChange={(event) => {
          palette.value = event.currentTarget.value as Palette;
        }}
      >
        {PALETTES.map((name) => (
          <option key={name} value={name}>
            {said(name)}
          </option>
        ))}
      </select>
    </label>
  );
}
