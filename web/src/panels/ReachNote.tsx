// Under the tools of the room: whose reach is drawn, and how good its outline is.

import { atLeast, withUnit } from "../figures";
import { stale } from "../page_state";
import { reaching } from "../view/reach";
import { said } from "../words";

export function ReachNote() {
  const now = reaching.value;
  if (!now) return null;
  const beyond = now.result?.value;
  return (
    <output class={`measure-note ${stale.value ? "stale" : ""}`} aria-live="polite">
      {now.of === "" && said("Select a robot, a person, or a body of them")}
      {now.of !== "" && (
        <>
          <span>{said("reach of {name}", { name: now.of })}</span>
          {now.refusal !== "" && <span class="unknown">{now.refusal}</span>}
          {now.refusal === "" && !now.result && <span>{said("searching …")}</span>}
          {beyond != null && (
            <span>
              {said("outline: places up to {size} outside may be reached, and some inside may not", {
                size: withUnit(atLeast(Math.ceil(beyond * 1000) / 1000, "m"), "m"),
              })}
            </span>
          )}
        </>
      )}
    </output>
  );
}
