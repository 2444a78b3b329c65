// A verdict as people see it: icon, word and look together, never colour alone. Out of date it is none.

import { stale } from "../page_state";
import { STATE_ICONS, STATE_WORDS, type State } from "../verdicts";
import { said, word } from "../words";

/** @param brief Whether the word is only for those who hear it. */
export function StateBadge({ state, brief = false }: { state: State; brief?: boolean }) {
  const old = stale.value;
  const verdict = said(old ? word("stale") : STATE_WORDS[state]);
  return (
    <span class={`badge state-${old ? "off" : state}`} title={brief ? verdict : undefined}>
      <span class="badge-icon" aria-hidden="true">
        {old ? "–" : STATE_ICONS[state]}
      </span>
      {brief ? <span class="visually-hidden">{verdict}</span> : verdict}
    </span>
  );
}
