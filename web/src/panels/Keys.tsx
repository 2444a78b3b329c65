// What the keys do, over the page.

import { effect, signal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";

export const keysShown = signal(false);

const KEYS: readonly [keys: string, does: string][] = [
  ["space", "play and pause; live: hold and follow"],
  ["← →", "one snapshot back or ahead; with shift, one second"],
  ["Home End", "to the begin; to the end, live: to the newest"],
  ["[ ]", "to where a limit begins to be exceeded, before or after"],
  ["W", "to the worst instant of the selected criterion, or of the one that is worst now"],
  ["L", "back to live"],
  ["F", "frame the selection"],
  ["D", "while editing: measure a distance, or end that"],
  ["M R", "while editing: handles to move, to turn what is selected"],
  ["Ctrl+Z Ctrl+Y", "while editing: undo, redo"],
  ["1 … 9", "markers of a criterion on and off"],
  ["Esc", "close what is open, or select nothing"],
  ["?", "these keys"],
];

export function Keys() {
  const dialog = useRef<HTMLDialogElement>(null);
  useEffect(
    () =>
      effect(() => {
        if (keysShown.value) dialog.current?.showModal();
        else dialog.current?.close();
      }),
    [],
  );
  return (
    <dialog
      ref={dialog}
      class="keys"
      aria-labelledby="keys-title"
      onClose={() => {
        keysShown.value = false;
      }}
    >
      <h2 id="keys-title">Keys</h2>
      <dl>
        {KEYS.map(([keys, does]) => (
          <div key={keys}>
            <dt>{keys.split(" ").map((key) => (key === "…" ? " … " : <kbd key={key}>{key}</kbd>))}</dt>
            <dd>{does}</dd>
          </div>
        ))}
      </dl>
      <form method="dialog">
        <button type="submit" class="link">
          close
        </button>
      </form>
    </dialog>
  );
}
