// Beside the verdict of this instant: what is worse at another one, and the way there.

import { signal, useSignalEffect } from "@preact/signals";
import { ago, type Elsewhere } from "../elsewhere";
import { against, withUnit } from "../figures";
import { formatTime } from "../format";
import { clock, isLive, lookingAt, now, scene, traces } from "../page_state";
import { STATE_ICONS, STATE_WORDS } from "../verdicts";
import { said, word } from "../words";
import { type Instant, worstWith } from "../worst_instant";
import { useActions } from "./app_context";

interface Visited {
  name: string;
  unit: string;
  atMost: boolean;
  instant: Instant;
  /** Whether it could be shown: a live run only keeps the last minutes, and who only looks on moves no cursor. */
  shown: boolean;
  /** Where the cursor of a recording is, or goes to [s]; and what of a live run was looked at then. */
  cursor: number;
  back: number | null;
  /** How near the cursor came to it [s]. */
  nearest: number;
}

/** What differs by less is the same instant on the page: times are read to a hundredth [s]. */
const NEAR_S = 0.01;

const TOO_OLD = word("older than what a live run keeps to look back at; the recording has it");

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
    const cursor = shown ? instant.t : now.peek();
    const back = lookingAt.peek();
    visited.value = {
      name,
      unit: info.unit,
      atMost: info.at_most,
      instant,
      shown,
      cursor,
      back,
      nearest: Number.POSITIVE_INFINITY,
    };
  };
  const more = criteria.length > 1 ? ` +${criteria.length - 1}` : "";
  return (
    <button
      type="button"
      class={`pill-elsewhere elsewhere-${verdict}`}
      title={`${criteria.join(", ")}\n${said("Click: go to the worst instant of {name}", { name })}`}
      // Seconds that count up are not worth being read aloud.
      aria-live="off"
      onClick={visit}
    >
      <span aria-hidden="true">{STATE_ICONS[verdict]} </span>
      {said(STATE_WORDS[verdict])} {following ? ago(clock.value - latest.end) : said("elsewhere")}: {name}
      {more}
    </button>
  );
}

// The cursor of a recording is moved by the server, a little later; that of a live run here, at once.
function movedOn(seen: Visited): boolean {
  if (isLive.value) return lookingAt.value !== seen.back;
  const off = Math.abs(now.value - seen.cursor);
  if (off <= seen.nearest) seen.nearest = off;
  return off > seen.nearest && seen.nearest <= Math.max(NEAR_S, scene.value?.period ?? 0);
}

/**
 * What was visited last, until the cursor moves on. Its figures stay readable even where the instant itself is no
 * longer kept.
 */
export function VisitedInstant() {
  const { time } = useActions();
  useSignalEffect(() => {
    if (visited.value && movedOn(visited.value)) visited.value = null;
  });
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
        {said("Worst of {name}", { name })}: <strong>{withUnit(figures.value, unit)}</strong>
        {limit} · {formatTime(instant.t)}
        {elsewhere && (
          <em> – {said("shown is {time}, the nearest that is kept", { time: formatTime(now.value) })}</em>
        )}
        {!shown && (
          <em> – {said(isLive.value ? TOO_OLD : word("whoever may control the replay goes there"))}</em>
        )}
      </span>
      {isLive.value && lookingAt.value !== null && (
        <button type="button" class="link" onClick={() => time.follow()}>
          {said("back to live")}
        </button>
      )}
      <button
        type="button"
        class="link"
        onClick={() => {
          visited.value = null;
        }}
      >
        {said("close")}
      </button>
    </div>
  );
}
