// The page: top bar, what is there, the room, the verdicts, time.

import { effect, useSignal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import { ownDevice } from "../company";
import { notRun } from "../editing/draft";
import { scene } from "../page_state";
import { type Column, folded, order, timeAbove, widths } from "../view/kept";
import { said } from "../words";
import { Strayed } from "./Bringing";
import { CameraNote } from "./CameraNote";
import { VisitedInstant } from "./ElsewhereNote";
import { Grip } from "./Grip";
import { Keys } from "./Keys";
import { Legend } from "./Legend";
import { MeasureNote } from "./MeasureNote";
import { PageTools } from "./PageTools";
import { Plots } from "./Plots";
import { ProbeNote } from "./ProbeNote";
import { Properties } from "./Properties";
import { ReachNote } from "./ReachNote";
import { RightSide } from "./RightSide";
import { SceneTree } from "./SceneTree";
import { Splitter } from "./Splitter";
import { Timeline } from "./Timeline";
import { TopBar } from "./TopBar";
import { TransportBar } from "./TransportBar";
import { ViewTools } from "./ViewTools";

export function App({ room }: { room: (element: HTMLElement) => void }) {
  const place = useRef<HTMLDivElement>(null);
  const plots = usePlotCount();
  // Whoever is in the room sees no panel of the page: none is drawn, and none grows old.
  const away = ownDevice.value !== "desk";
  useEffect(() => room(place.current!), [room]);
  useEffect(
    () =>
      effect(() => {
        document.title = scene.value ? `${scene.value.title} – seerob` : "seerob";
      }),
    [],
  );
  return (
    <div
      class={[
        "app",
        timeAbove.value ? "time-above" : "",
        ...folded.value.map((panel) => `without-${panel}`),
      ].join(" ")}
      style={{
        "--middle": `"${order.value.join(" ")}"`,
        "--columns": order.value.map(columnOf).join(" "),
      }}
    >
      <TopBar />
      <aside class="left" aria-label={said("Scene and properties")}>
        <Grip panel="left" name={said("Scene and properties")} />
        {!away && <SceneTree />}
        {/* biome-ignore lint/a11y/noNoninteractiveTabindex: what scrolls can be reached by keys */}
        <section class="selection scroll" aria-label={said("Properties")} tabIndex={0}>
          {!away && <Properties />}
        </section>
        <Splitter panel="left" name={said("Scene and properties")} />
      </aside>
      <main class="centre">
        <div class="room" ref={place} />
        <ViewTools />
        {!away && (
          <>
            <MeasureNote />
            <ProbeNote />
            <ReachNote />
            <CameraNote />
            <Legend />
            <VisitedInstant />
            <Strayed />
          </>
        )}
      </main>
      {away ? <aside class="right" /> : <RightSide />}
      <footer class="bottom">
        <Grip panel="bottom" name={said("Plots and time")} />
        {!away && !notRun.value && <Plots count={plots} />}
        <div class="time-row">
          {away ? (
            <p class="not-run">{said("You are in the room: what these panels say hangs there.")}</p>
          ) : notRun.value ? (
            <p class="not-run">{said("Nothing is run: this is where everybody begins.")}</p>
          ) : (
            <TransportBar />
          )}
          {!away && <PageTools />}
        </div>
        {!away && !notRun.value && <Timeline />}
      </footer>
      <Keys />
    </div>
  );
}

/** Of columns whose width nobody chose. */
const WIDTHS: Record<Column, string> = {
  left: "clamp(190px, 17vw, 270px)",
  centre: "minmax(0, 1fr)",
  right: "clamp(396px, 30vw, 460px)",
};

function columnOf(column: Column): string {
  if (column !== "centre" && folded.value.includes(column)) return "0px";
  const width = column === "centre" ? undefined : widths.value[column];
  return width === undefined ? WIDTHS[column] : `min(${width}px, 60vw)`;
}

const PLOT_LEAST_PX = 400;

function usePlotCount(): number {
  const count = useSignal(fitting());
  useEffect(() => {
    const resized = (): void => {
      count.value = fitting();
    };
    addEventListener("resize", resized);
    return () => removeEventListener("resize", resized);
  }, [count]);
  return count.value;
}

function fitting(): number {
  return Math.min(4, Math.max(2, Math.floor(innerWidth / PLOT_LEAST_PX)));
}
