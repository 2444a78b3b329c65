// Where a criterion was at its worst, as buttons that lead there.

import { against, withUnit } from "../figures";
import { formatTime } from "../format";
import { STATE_ICONS, STATE_WORDS } from "../verdicts";
import type { CriterionInfo } from "../wire";
import { said } from "../words";
import { type Instant, verdictOf } from "../worst_instant";
import { useActions } from "./app_context";

export function Instants({ info, instants }: { info: CriterionInfo; instants: readonly Instant[] }) {
  const { time } = useActions();
  return (
    <>
      {instants.map((instant, i) => {
        const verdict = verdictOf(instant);
        return (
          <button
            key={instant.t}
            type="button"
            class={`jump ${verdict ? `state-${verdict}` : ""}`}
            title={`${said("Go to {time}", { time: formatTime(instant.t) })}${verdict ? `: ${said(STATE_WORDS[verdict])}` : ""}`}
            data-worst={i === 0 ? info.name : undefined}
            onClick={() => time.visit(instant.t)}
          >
            {verdict && <span aria-hidden="true">{STATE_ICONS[verdict]} </span>}
            <strong>{figureOf(instant, info)}</strong> {formatTime(instant.t)}
          </button>
        );
      })}
    </>
  );
}

function figureOf({ value, limit }: Instant, { unit, at_most }: CriterionInfo): string {
  return withUnit(against(value, limit, unit, at_most).value, unit);
}
