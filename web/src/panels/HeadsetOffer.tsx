// Lets whoever wears a headset be the person of the workstation: shown where there is one, in a live run.

import { useEffect, useState } from "preact/hooks";
import { isLive, mayTrack, scene, tracked } from "../page_state";
import { Offering, sessionMode } from "../xr/offering";
import { useActions } from "./app_context";

export function HeadsetOffer() {
  const [there, setThere] = useState(false);
  const [offering, setOffering] = useState<Offering | null>(null);
  const [failure, setFailure] = useState("");
  const { offer } = useActions();
  useEffect(() => {
    sessionMode().then((mode) => setThere(mode !== null));
  }, []);
  if (!there || !isLive.value || !mayTrack.value) return null;
  const people = new Set(scene.value?.nodes.filter((n) => n.role === "human").map((n) => n.owner));
  const begin = async (human: string): Promise<void> => {
    setFailure("");
    try {
      const begun = await Offering.begin(human, offer);
      begun.session.addEventListener("end", () => setOffering(null));
      setOffering(begun);
    } catch (error) {
      setFailure(error instanceof Error ? error.message : String(error));
    }
  };
  const answer = tracked.value;
  const said = failure || (answer && !answer.accepted ? answer.reason : "");
  return (
    <div class="headset-offer">
      {[...people].map((human) => (
        <button key={human} type="button" disabled={offering !== null} onClick={() => void begin(human)}>
          {offering ? "headset on" : `be ${human}`}
        </button>
      ))}
      {said && <span role="alert">{said}</span>}
    </div>
  );
}
