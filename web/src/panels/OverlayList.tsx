// The legend of the room: which criterion draws what, in which state it is, and whether it is shown.

import { kindsOf, SIGNS } from "../markers/signs";
import { mutedCriteria, rows, stale, toggleMuted } from "../page_state";
import { showCaptions, showGrid } from "../scene/viewer";
import { said, told } from "../words";
import { StateBadge } from "./StateBadge";

const KEYS = 9;

export function OverlayList() {
  return (
    <div class="overlay-list" id="overlays">
      {rows.value.map(({ info, result, state }, i) => (
        <label key={info.name} title={told(info.title)}>
          <input
            type="checkbox"
            checked={!mutedCriteria.value.has(info.name)}
            onChange={() => toggleMuted(info.name)}
          />
          <span class="overlay-name">{info.name}</span>
          <Signs markers={stale.value ? [] : (result?.markers ?? [])} />
          <span class={stale.value ? "stale" : ""}>
            <StateBadge state={state} brief />
          </span>
          {i < KEYS ? <kbd>{i + 1}</kbd> : <span />}
        </label>
      ))}
      <hr />
      <Choice title={said("Labels of the worst three")} shown={showCaptions} />
      <Choice title={said("Floor grid")} shown={showGrid} />
    </div>
  );
}

function Signs({ markers }: { markers: Parameters<typeof kindsOf>[0] }) {
  const kinds = kindsOf(markers);
  if (kinds.length === 0) return <span class="unknown">{said("nothing drawn")}</span>;
  return (
    <span class="signs" role="img" aria-label={kinds.map((kind) => SIGNS[kind].word).join(", ")}>
      {kinds.map((kind) => (
        <svg key={kind} class={`sign ${SIGNS[kind].filled ? "filled" : ""}`} viewBox="0 0 24 16">
          <title>{SIGNS[kind].word}</title>
          <path d={SIGNS[kind].path} />
        </svg>
      ))}
    </span>
  );
}

function Choice({ title, shown }: { title: string; shown: typeof showGrid }) {
  return (
    <label>
      <input
        type="checkbox"
        checked={shown.value}
        onChange={() => {
          shown.value = !shown.value;
        }}
      />
      <span class="overlay-name">{title}</span>
    </label>
  );
}
