// Beside the verdict of this instant: what is worse at another one, and the way there.

import { signal } from "@preact/signals";
import { ago, type Elsewhere } from "../elsewhere";
import { against, withUnit } from "../figures";
import { formatTime } from "../format";
import { isLive, lookingAt, now, scene, traces } from "../page_state";
import { STATE_ICONS, STATE_WORDS } from "../verdicts";
import { type Instant, worstWith } from "../worst_instant";
import { useActions } from "./app_context";

interface Visited {
  name: string;
  unit: string;
  atMost: boolean;
  instant: Instant;
  /** Whether it could be shown; a live run only keeps the last minutes. */
  shown: boolean;
}

/** What differs by less is the same instant on the page: times are read to a hundredth [s]. */
const NEAR_S = 0.01;

const visited = signal<Visited | null>(null);

export function ElsewhereNote({ other }: { other: Elsewhere }) {
  const { time } = useActions();
  const { verdict, criteria, latest } = other;
  const following = isLive.value && lookingAt.value === null;
  const name = following ? latest.name : criteria[0]!;
  const visit = (): void => {
    const trace = traces.get(name);
    const info = scene.value?.criteria.find((criterion) => criterion.name === name);
    if (!trace || !info) return;
    const instant = worstWith(trace, info.at_most, verdict);
    if (!instant) return;
    const shown = time.visit(instant.t);
    visited.value = { name, unit: info.unit, atMost: info.at_most, instant, shown };
  };
  const more = criteria.length > 1 ? ` +${criteria.length - 1}` : "";
  return (
    <button
      type="button"
      class={`pill-elsewhere elsewhere-${verdict}`}
      title={`${criteria.join(", ")}\nClick: go to the worst instant of ${name}`}
      // Seconds that count up are not worth being read aloud.
      aria-live="off"
      onClick={visit}
    >
      <span aria-hidden="true">{STATE_ICONS[verdict]} </span>
      {STATE_WORDS[verdict]} {following ? ago(now.value - latest.end) : "elsewhere"}: {name}
      {more}
    </button>
  );
}

/** What was visited last: its figures stay readable even where the instant itself is no longer kept. */
export function VisitedInstant() {
  const { time } = useActions();
  const seen = visited.value;
  if (!seen) return null;
  const { name, unit, atMost, instant, shown } = seen;
  const figures = against(instant.value, instant.limit, unit, atMost);
  const limit = Number.isNaN(instant.limit)
    ? ""
    : ` (${atMost ? "≤" : "≥"} ${withUnit(figures.limit, unit)})`;
  const elsewhere = shown && lookingAt.value === instant.t && Math.abs(now.value - instant.t) > NEAR_S;
  return (
    <div class="visited" role="status">
      <span>
        Worst of <strong>{name}</strong>: <strong>{withUnit(figures.value, unit)}</strong>
        {limit} at {formatTime(instant.t)}
        {elsewhere && <em> – shown is {formatTime(now.value)}, the nearest that is kept</em>}
        {!shown && <em> – older than what a live run keeps to look back at; the recording has it</em>}
      </span>
      {isLive.value && lookingAt.value !== null && (
        <button
          type="button"
          class="link"
          onClick={() => {
            visited.value = null;
            time.follow();
          }}
        >
          back to live
        </button>
      )}
      <button
        type="button"
        class="visited-close"
        aria-label="Close"
        onClick={() => {
          visited.value = null;
        }}
      >
        ✕
      </button>
    </div>
  );
}
