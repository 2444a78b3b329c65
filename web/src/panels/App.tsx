// The page: top bar, what is there, the room, the verdicts, time.

import { effect, useSignal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import { scene } from "../page_state";
import { CriteriaTable } from "./CriteriaTable";
import { allFindings, Findings } from "./Findings";
import { Plots } from "./Plots";
import { Properties } from "./Properties";
import { SceneTree } from "./SceneTree";
import { Timeline } from "./Timeline";
import { TopBar } from "./TopBar";
import { TransportBar } from "./TransportBar";
import { ViewTools } from "./ViewTools";

export function App({ room }: { room: (element: HTMLElement) => void }) {
  const place = useRef<HTMLDivElement>(null);
  useEffect(() => room(place.current!), [room]);
  useEffect(
    () =>
      effect(() => {
        document.title = scene.value ? `${scene.value.title} – seerob` : "seerob";
      }),
    [],
  );
  return (
    <div class="app">
      <TopBar />
      <aside class="left" aria-label="Scene and properties">
        <SceneTree />
        <section class="selection scroll" aria-label="Properties">
          <Properties />
        </section>
      </aside>
      <main class="centre">
        <div class="room" ref={place} />
        <ViewTools />
      </main>
      <RightSide />
      <footer class="bottom">
        <Plots count={usePlotCount()} />
        <TransportBar />
        <Timeline />
      </footer>
    </div>
  );
}

function RightSide() {
  const tab = useSignal<"criteria" | "findings">("criteria");
  const findings = allFindings();
  const warnings = findings.filter((finding) => finding.level !== "note").length;
  return (
    <aside class="right" aria-label="Results">
      <div class="tabs" role="tablist">
        <button
          type="button"
          role="tab"
          aria-selected={tab.value === "criteria"}
          onClick={() => {
            tab.value = "criteria";
          }}
        >
          Criteria
        </button>
        <button
          type="button"
          role="tab"
          aria-selected={tab.value === "findings"}
          onClick={() => {
            tab.value = "findings";
          }}
        >
          Findings{" "}
          <span class={warnings > 0 ? "count count-warn" : "count"}>
            {warnings > 0 ? `! ${findings.length}` : findings.length}
          </span>
        </button>
      </div>
      {tab.value === "criteria" ? <CriteriaTable /> : <Findings />}
      <p class="disclaimer">Evaluation of a model, to be confirmed by measurement.</p>
    </aside>
  );
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
