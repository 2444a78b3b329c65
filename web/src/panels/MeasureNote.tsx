// Under the tools of the room: what is measured, and how far it is.

import { notRun } from "../editing/draft";
import { atLeast, withUnit } from "../figures";
import { formatNumber } from "../format";
import { stale } from "../page_state";
import { measuring } from "../view/measure";
import { said } from "../words";

export function MeasureNote() {
  const now = measuring.value;
  if (!now) return null;
  const [a, b] = now.picks;
  const { result, refusal, angle } = now;
  return (
    <output class={`measure-note ${stale.value ? "stale" : ""}`} aria-live="polite">
      {!a && said("Pick the first surface, in the room or in the tree")}
      {a && !b && said("{name}, and the second one …", { name: a.name })}
      {a && b && (
        <>
          <span>
            {a.name} ↔ {b.name}
          </span>
          {refusal !== "" && <span class="unknown">{refusal}</span>}
          {refusal === "" && !result && <span>{said("measuring …")}</span>}
          {result?.value != null && <strong>{distance(result.value)}</strong>}
          {result?.interval && (
            <span>{said("real surfaces: from {size}", { size: size(result.interval[0]) })}</span>
          )}
          {result?.t != null && !notRun.value && <span>{said("at {t} s", { t: result.t.toFixed(2) })}</span>}
          {angle !== null && (
            <span>{said("faces as drawn at {angle}°", { angle: formatNumber(angle) })}</span>
          )}
        </>
      )}
    </output>
  );
}

/** A distance in words: never farther and never less deep than it is. */
export function distance(value: number): string {
  return value < 0
    ? said("overlap, {size} deep at least", { size: size(value).replace("−", "") })
    : size(value);
}

const size = (metres: number): string => withUnit(atLeast(metres, "m"), "m");
