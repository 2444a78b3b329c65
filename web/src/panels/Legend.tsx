// In the room: what its colours mean, as long as they mean something.

import { doubts } from "../doubts";
import { scene, stale } from "../page_state";
import { coloring, hasScores, shownScore } from "../posture/coloring";
import { roomLook } from "../scene/room_look";
import { said, word } from "../words";
import { ScaleBar } from "./ScoreColors";
import { StateBadge } from "./StateBadge";

const SHOWN = ["within", "exceeded", "undecided", "none"] as const;

/** A colour of the room, for style sheets. */
const css = (color: number): string => `#${color.toString(16).padStart(6, "0")}`;

export function Legend() {
  if (!scene.value || stale.value) return null;
  return (
    <section class="legend" aria-label={said("Colours")}>
      <ul>
        {SHOWN.map((state) => (
          <li key={state}>
            <StateBadge state={state} />
          </li>
        ))}
        {doubts.value.size > 0 && (
          <li class="doubt-key" style={{ "--doubt": css(roomLook.value.tones.doubt) }}>
            <i aria-hidden="true" /> {said("may be elsewhere")}
          </li>
        )}
      </ul>
      {hasScores.value && coloring.value !== "verdict" && shownScore.value !== null && (
        <p>
          {said(
            coloring.value === "overall"
              ? word("person: {score} overall, best")
              : word("person: {score} by body part, best"),
            { score: shownScore.value },
          )}{" "}
          <ScaleBar /> {said("worst; own colour: not scored")}
        </p>
      )}
    </section>
  );
}
