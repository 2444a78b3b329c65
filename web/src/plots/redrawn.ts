// What is drawn over time is drawn anew at its own pace: nothing of it runs in a picture of the room, in each of which
// the time cursor is elsewhere.

import { untracked } from "@preact/signals";
import { ownDevice } from "../company";
import { redrawEveryMs } from "../scene/effort";

/**
 * Draw, and again when something that is read is another one.
 *
 * @param read What is drawn depends on.
 * @returns Ends it.
 */
export function redrawn(read: () => readonly unknown[], draw: () => void): () => void {
  let before: readonly unknown[] = [];
  let timer: ReturnType<typeof setTimeout>;
  const look = (): void => {
    const found = untracked(read);
    if (found.some((one, k) => !Object.is(one, before[k]))) {
      before = found;
      draw();
    }
    timer = setTimeout(look, redrawEveryMs(ownDevice.peek() !== "desk"));
  };
  look();
  return () => clearTimeout(timer);
}
