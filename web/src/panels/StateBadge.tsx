// A verdict as people see it: icon, word and look together, never colour alone.

import { STATE_ICONS, STATE_WORDS, type State } from "../verdicts";

/** @param brief Whether the word is only for those who hear it. */
export function StateBadge({ state, brief = false }: { state: State; brief?: boolean }) {
  return (
    <span class={`badge state-${state}`} title={brief ? STATE_WORDS[state] : undefined}>
      <span class="badge-icon" aria-hidden="true">
        {STATE_ICONS[state]}
      </span>
      {brief ? <span class="visually-hidden">{STATE_WORDS[state]}</span> : STATE_WORDS[state]}
    </span>
  );
}
