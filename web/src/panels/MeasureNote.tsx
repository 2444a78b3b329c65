// Under the tools of the room: what is measured, and how far it is.

import { faceAngle, measuring } from "../editing/measure";
import { formatFixed, formatNumber } from "../format";
import { said } from "../words";

export function MeasureNote() {
  const now = measuring.value;
  if (!now) return null;
  const [a, b] = now.picks;
  const angle = faceAngle(now);
  const value = now.result?.value;
  return (
    <output class="measure-note" aria-live="polite">
      {!a && "Pick the first surface, in the room or in the tree"}
      {a && !b && `${a.name}, and the second one …`}
      {a && b && (
        <>
          <span>
            {a.name} ↔ {b.name}
          </span>
          {now.refusal !== "" && <span class="unknown">{now.refusal}</span>}
          {now.refusal === "" && !now.result && <span>{said("measuring …")}</span>}
          {value != null && <strong>{distance(value)}</strong>}
          {now.result && value == null && <span class="unknown">{now.result.reason}</span>}
          {angle !== null && <span>faces as drawn at {formatNumber(angle)}°</span>}
        </>
      )}
    </output>
  );
}

// To tenths of a millimetre, never farther and never less deep than it is.
function distance(value: number): string {
  const text = `${formatFixed(Math.floor(value * 1e4) / 1e4, 4).replace("−", "")} m`;
  return value < 0 ? `overlap, ${text} deep at least` : text;
}
