// What a save would change, line by line, before it is saved.

import { useEffect, useRef } from "preact/hooks";
import { ask, draft, refused } from "../editing/draft";
import { said } from "../words";
import { MistakeList } from "./MistakeList";

const LOOKS: Record<string, string> = { "+": "added", "-": "removed", "@": "place" };

export function Review({ open, close }: { open: boolean; close: () => void }) {
  const dialog = useRef<HTMLDialogElement>(null);
  useEffect(() => {
    if (open) dialog.current?.showModal();
    else dialog.current?.close();
  }, [open]);
  const now = draft.value;
  const lines = now?.diff.split("\n").slice(2) ?? [];
  const finish = async (action: string): Promise<void> => {
    if (await ask(action)) close();
  };
  return (
    <dialog ref={dialog} class="review" aria-labelledby="review-title" onClose={close}>
      <h2 id="review-title">{said("What changes in {file}", { file: now?.file ?? "" })}</h2>
      {/* biome-ignore lint/a11y/noNoninteractiveTabindex: what scrolls can be reached by keys */}
      <section class="scroll" tabIndex={0} aria-label={said("Changes")}>
        <pre>
          {lines.map((line, k) => (
            <span key={k} class={LOOKS[line[0] ?? ""] ?? ""}>
              {line}
              {"\n"}
            </span>
          ))}
        </pre>
      </section>
      {open && <MistakeList mistakes={refused.value?.mistakes ?? []} keys />}
      <div class="edit-bar">
        <button type="button" class="primary" onClick={() => void finish("save")}>
          {said("Save")}
        </button>
        <button type="button" onClick={() => void finish("discard")}>
          {said("Discard")}
        </button>
        <button type="button" onClick={close}>
          {said("Go on editing")}
        </button>
      </div>
    </dialog>
  );
}
