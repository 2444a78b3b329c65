// The grip of a panel: dragged to another place, or moved by arrow keys.

import { useSignal } from "@preact/signals";
import { type Column, moveColumn, order, type Panel, timeAbove } from "../view/kept";
import { said } from "../words";

export function Grip({ panel, name }: { panel: Panel; name: string }) {
  const held = useSignal(false);
  const title = said("Place of {name}: drag it, or use the arrow keys", { name });
  return (
    <button
      type="button"
      class={held.value ? "grip held" : "grip"}
      title={title}
      aria-label={title}
      onPointerDown={(event) => {
        event.currentTarget.setPointerCapture(event.pointerId);
        held.value = true;
      }}
      onPointerMove={({ clientX, clientY }) => {
        if (!held.value) return;
        if (panel === "bottom") timeAbove.value = clientY < innerHeight / 2;
        else passNeighbour(panel, clientX);
      }}
      onLostPointerCapture={() => {
        held.value = false;
      }}
      onKeyDown={(event) => {
        if (!moveBy(panel, event.key)) return;
        event.preventDefault();
        event.stopPropagation();
      }}
    />
  );
}

// Past the middle of its neighbour it is on the other side of it, and its neighbour's middle on this one.
function passNeighbour(panel: Column, x: number): void {
  const at = order.value.indexOf(panel);
  for (const step of [-1, 1] as const) {
    const neighbour = order.value[at + step];
    const box = neighbour && document.querySelector(`.app > .${neighbour}`)?.getBoundingClientRect();
    if (box && step * (x - (box.left + box.right) / 2) > 0) {
      moveColumn(panel, step);
      return;
    }
  }
}

function moveBy(panel: Panel, key: string): boolean {
  if (panel === "bottom") {
    if (key !== "ArrowUp" && key !== "ArrowDown") return false;
    timeAbove.value = key === "ArrowUp";
    return true;
  }
  if (key !== "ArrowLeft" && key !== "ArrowRight") return false;
  moveColumn(panel, key === "ArrowLeft" ? -1 : 1);
  return true;
}
