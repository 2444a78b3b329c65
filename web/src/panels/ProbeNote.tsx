// Under the tools of the room: the point that is probed, and how fast it moves.

import { figure, withUnit } from "../figures";
import { stale } from "../page_state";
import { probe, probing } from "../view/probe";
import { said } from "../words";

export function ProbeNote() {
  if (!probing.value) return null;
  const now = probe.value;
  if (!now) return <output class="measure-note">{said("Pick a point in the room")}</output>;
  const place = now.at.map((x) => withUnit(figure(x, "m"), "m")).join(", ");
  return (
    <output class={`measure-note ${stale.value ? "stale" : ""}`}>
      <span>
        {now.name} ({place})
      </span>
      <strong>{now.speed === null ? "–" : withUnit(figure(now.speed, "m/s"), "m/s")}</strong>
      <span>
        {now.speed === null
          ? said("two instants are needed, close to one another")
          : said("mean over {ms} ms, of poses as shown: no criterion's figure", {
              ms: Math.round(now.over * 1000),
            })}
      </span>
    </output>
  );
}
