// The edge between a panel and the room: dragged, or moved by arrow keys; a double click or Home gives it back.

import { useSignal } from "@preact/signals";
import { type Column, order, setWidth, widths } from "../view/kept";
import { said } from "../words";

const STEP_PX = 16;

export function Splitter({ panel, name }: { panel: Exclude<Column, "centre">; name: string }) {
  const dragged = useSignal(false);
  const at = order.value;
  // Its panel lies left of the room: then it grows to the right.
  const grows = at.indexOf(panel) < at.indexOf("centre") ? 1 : -1;
  const widthOf = (handle: EventTarget): number => (handle as HTMLElement).parentElement!.offsetWidth;
  return (
    // biome-ignore lint/a11y/useSemanticElements: a rule that can be moved
    <div
      class={`splitter splitter-${grows > 0 ? "right" : "left"}`}
      role="separator"
      aria-orientation="vertical"
      aria-label={said("Width of {name}", { name })}
      aria-valuenow={widths.value[panel] ?? 0}
      tabIndex={0}
      onDblClick={() => setWidth(panel, null)}
      onPointerDown={(event) => {
        event.currentTarget.setPointerCapture(event.pointerId);
        dragged.value = true;
        event.preventDefault();
      }}
      onPointerMove={(event) => {
        if (!dragged.value) return;
        const { left, right } = event.currentTarget.parentElement!.getBoundingClientRect();
        setWidth(panel, grows > 0 ? event.clientX - left : right - event.clientX);
      }}
      onLostPointerCapture={() => {
        dragged.value = false;
      }}
      onKeyDown={(event) => {
        const step = { ArrowRight: grows, ArrowLeft: -grows }[event.key];
        if (event.key === "Home") setWidth(panel, null);
        else if (step) setWidth(panel, widthOf(event.currentTarget) + step * STEP_PX);
        else return;
        event.preventDefault();
        event.stopPropagation();
      }}
    />
  );
}
