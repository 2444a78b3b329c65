// Time as a strip: a lane per criterion with a limit, coloured where it is exceeded or undecided.

import { untracked } from "@preact/signals";
import { useLayoutEffect, useRef } from "preact/hooks";
import { formatTime } from "../format";
import { clock, now, scene, select, selection, stale, tracesRevision } from "../page_state";
import { held, shownRange, timeAt } from "../plots/axis";
import { drawLanes, lanePx } from "../plots/lanes";
import { isJudged, ranked } from "../plots/ranking";
import { redrawn } from "../plots/redrawn";
import { theme } from "../theme";
import { said } from "../words";
import { useActions } from "./app_context";

export function Timeline() {
  const { time } = useActions();
  const canvas = useRef<HTMLCanvasElement>(null);
  void tracesRevision.value;
  const tall = lanePx();
  const judged = ranked((scene.value?.criteria ?? []).filter(isJudged));
  const names = judged.map((c) => c.name);
  const key = names.join("\n");

  // Before the names are seen: lanes beside the names of others would be a wrong statement.
  useLayoutEffect(() => {
    const target = canvas.current;
    if (!target) return;
    const draw = (): void =>
      drawLanes(target, key === "" ? [] : key.split("\n"), untracked(shownRange), now.peek(), stale.peek());
    const stop = redrawn(
      () => [tracesRevision.value, now.value, shownRange(), stale.value, theme.value],
      draw,
    );
    const resized = new ResizeObserver(draw);
    resized.observe(target);
    return () => {
      stop();
      resized.disconnect();
    };
  }, [key, tall]);

  const seekTo = (event: PointerEvent): void => {
    const box = canvas.current!.getBoundingClientRect();
    time.seek(timeAt(shownRange(), (event.clientX - box.left) / box.width));
  };
  const { start, end } = shownRange();
  return (
    <div class="timeline">
      <div class="lanes scroll">
        <ul class="lane-names">
          {names.map((name) => (
            <li key={name} style={{ height: `${tall}px` }}>
              <button
                type="button"
                title={name}
                class={selection.value?.name === name ? "selected" : ""}
                onClick={() => select({ kind: "criterion", name })}
              >
                {name}
              </button>
            </li>
          ))}
        </ul>
        <canvas
          ref={canvas}
          class="strip"
          style={{ height: `${Math.max(1, names.length) * tall}px` }}
          tabIndex={0}
          role="slider"
          aria-label={said("Time cursor")}
          aria-valuemin={start}
          aria-valuemax={end}
          aria-valuenow={Number.isFinite(clock.value) ? clock.value : start}
          aria-valuetext={formatTime(clock.value)}
          onPointerDown={(event) => {
            event.currentTarget.setPointerCapture(event.pointerId);
            held.value = shownRange();
            seekTo(event);
          }}
          onLostPointerCapture={() => {
            held.value = null;
          }}
          onPointerMove={(event) => {
            if (event.buttons & 1) seekTo(event);
          }}
        />
      </div>
      <div class="strip-ends" aria-hidden="true">
        <span>{formatTime(start)}</span>
        <span>{formatTime(end)}</span>
      </div>
    </div>
  );
}
