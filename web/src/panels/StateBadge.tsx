// A verdict as people see it: icon, word and look together, never colour alone.

import { STATE_ICONS, STATE_WORDS, type State } from "../verdicts";

export function StateBadge({ state }: { state: State }) {
  return (
    <span class={`badge state-${state}`}>
      <span class="badge-icon" aria-hidden="true">
        {STATE_ICONS[state]}
      </span>
      {STATE_WORDS[state]}
    </span>
  );
}
