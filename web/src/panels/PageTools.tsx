// What is of the page itself, not of the run: its look, and its keys.

import { chosenTheme, THEMES } from "../theme";
import { keysShown } from "./Keys";

export function PageTools() {
  return (
    <div class="page-tools">
      <select
        aria-label="Look"
        value={chosenTheme.value}
        onChange={(event) => {
          chosenTheme.value = THEMES.find((one) => one === event.currentTarget.value) ?? "system";
        }}
      >
        {THEMES.map((one) => (
          <option key={one} value={one}>
            {one}
          </option>
        ))}
      </select>
      <button
        type="button"
        title="What the keys do (?)"
        onClick={() => {
          keysShown.value = true;
        }}
      >
        Keys <kbd>?</kbd>
      </button>
    </div>
  );
}
