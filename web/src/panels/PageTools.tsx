// What is of the page itself, not of the run: its look, and its keys.

import { lengthUnit } from "../editing/handles";
import { chosenTheme, THEMES } from "../theme";
import { ANGLES, angleUnit } from "../units";
import { LANGUAGE_NAMES, LANGUAGES, type Language, language, said } from "../words";
import { Choice } from "./Choice";
import { keysShown } from "./Keys";

export function PageTools() {
  return (
    <div class="page-tools">
      <Choice
        name={said("Language")}
        choices={LANGUAGES}
        chosen={language}
        title={(one: Language) => LANGUAGE_NAMES[one]}
      />
      <Choice name={said("Lengths")} choices={["m", "mm"] as const} chosen={lengthUnit} />
      <Choice name={said("Angles")} choices={ANGLES} chosen={angleUnit} title={said} />
      <select
        aria-label={said("Look")}
        value={chosenTheme.value}
        onChange={(event) => {
          chosenTheme.value = THEMES.find((one) => one === event.currentTarget.value) ?? "system";
        }}
      >
        {THEMES.map((one) => (
          <option key={one} value={one}>
            {said(one)}
          </option>
        ))}
      </select>
      <button
        type="button"
        title={said("What the keys do (?)")}
        onClick={() => {
          keysShown.value = true;
        }}
      >
        {said("Keys")} <kbd>?</kbd>
      </button>
    </div>
  );
}
