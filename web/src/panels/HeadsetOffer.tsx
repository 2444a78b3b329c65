// Lets whoever wears a headset into the room: to look, or, in a live run, as a person of the workstation.

import { useEffect, useState } from "preact/hooks";
import { ownScale, SCALES } from "../company";
import { isLive, mayTrack, scene, tracked } from "../page_state";
import { said, told, word } from "../words";
import { type Mode, sessionModes } from "../xr/visit";
import { useActions } from "./app_context";

const WORDS: Record<Mode, string> = { "immersive-vr": "VR", "immersive-ar": "AR" };

export function HeadsetOffer() {
  const [modes, setModes] = useState<readonly Mode[]>([]);
  const [inside, setInside] = useState(false);
  const [failure, setFailure] = useState("");
  const { enter } = useActions();
  useEffect(() => {
    sessionModes().then(setModes);
  }, []);
  if (modes.length === 0) return null;
  const people = new Set(scene.value?.nodes.filter((n) => n.role === "human").map((n) => n.owner));
  const may = isLive.value && mayTrack.value;
  const begin = async (mode: Mode, human: string | null): Promise<void> => {
    setFailure("");
    try {
      const session = await enter(mode, human);
      session.addEventListener("end", () => setInside(false));
      setInside(true);
    } catch (error) {
      setFailure(error instanceof Error ? error.message : String(error));
    }
  };
  const answer = tracked.value;
  const complaint = failure || (answer && !answer.accepted ? answer.reason : "");
  return (
    <div class="headset-offer">
      {inside && <span role="status">{said("headset on")}</span>}
      <label class="own-scale">
        {said("my size")}
        <select
          value={String(ownScale.value)}
          onChange={(event) => {
            ownScale.value = Number(event.currentTarget.value);
          }}
        >
          {SCALES.map((scale) => (
            <option key={scale} value={String(scale)}>
              ×{scale}
            </option>
          ))}
        </select>
      </label>
      {!inside && (
        <details class="room-offer">
          <summary>{said("enter the room")}</summary>
          <div class="room-choices">
            {modes.map((mode) => (
              <button
                key={mode}
                type="button"
                title={said(TITLES[mode])}
                onClick={() => void begin(mode, null)}
              >
                {said("enter {mode}", { mode: WORDS[mode] })}
              </button>
            ))}
            {may &&
              [...people].flatMap((human) =>
                modes.map((mode) => (
                  <button key={human + mode} type="button" onClick={() => void begin(mode, human)}>
                    {modes.length > 1
                      ? said("be {name} in {mode}", { name: human, mode: WORDS[mode] })
                      : said("be {name}", { name: human })}
                  </button>
                )),
              )}
          </div>
        </details>
      )}
      {complaint && (
        <span role="alert" title={told(complaint)}>
          {told(complaint)}
        </span>
      )}
    </div>
  );
}

const TITLES: Record<Mode, string> = {
  "immersive-vr": word("Stand in the twin"),
  "immersive-ar": word("See the twin where you are"),
};
