// What the keys do, over the page.

import { effect, signal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import { said, word } from "../words";

export const keysShown = signal(false);

const KEYS: readonly [keys: string, does: string][] = [
  ["space", word("play and pause; live: hold and follow")],
  ["← →", word("one snapshot back or ahead; with shift, one second")],
  ["Home End", word("to the begin; to the end, live: to the newest")],
  ["[ ]", word("to where a limit begins to be exceeded, before or after")],
  ["W", word("to the worst instant of the selected criterion, or of the run")],
  ["L", word("back to live")],
  ["F", word("frame the selection")],
  ["D", word("measure a distance, or end that")],
  ["M R", word("while editing: handles to move, to turn what is selected")],
  ["Ctrl+Z Ctrl+Y", word("while editing: undo, redo")],
  ["1 … 9", word("markers of a criterion on and off")],
  ["Esc", word("close what is open, or select nothing")],
  ["?", word("these keys")],
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
      <h2 id="keys-title">{said("Keys")}</h2>
      <dl>
        {KEYS.map(([keys, does]) => (
          <div key={keys}>
            <dt>{keys.split(" ").map((key) => (key === "…" ? " … " : <kbd key={key}>{key}</kbd>))}</dt>
            <dd>{said(does)}</dd>
          </div>
        ))}
      </dl>
      <form method="dialog">
        <button type="submit" class="link">
          {said("close")}
        </button>
      </form>
    </dialog>
  );
}
