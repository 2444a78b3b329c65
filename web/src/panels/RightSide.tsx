// What is said: verdicts, contacts on the body, posture, and what to know of the model.

import { computed, useSignal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { controls, isLoose } from "../doing";
import { mayEdit } from "../editing/draft";
import { scene } from "../page_state";
import { said, word } from "../words";
import { BodyMap } from "./BodyMap";
import { listenToDrops } from "./Bringing";
import { CriteriaTable } from "./CriteriaTable";
import { Editor } from "./Editor";
import { allFindings, Findings } from "./Findings";
import { Grip } from "./Grip";
import { Posture } from "./Posture";
import { Room } from "./Room";
import { Splitter } from "./Splitter";

const TABS = ["edit", "criteria", "body", "posture", "room", "findings"] as const;
type Tab = (typeof TABS)[number];

const TITLES: Record<Tab, string> = {
  edit: word("Edit"),
  criteria: word("Criteria"),
  body: word("Body"),
  posture: word("Posture"),
  room: word("Room"),
  findings: word("Findings"),
};

const hasRoom = computed(() => controls.value.length > 0 || (scene.value?.nodes.some(isLoose) ?? false));

export function RightSide() {
  const tab = useSignal<Tab | null>(null);
  const tabs = TABS.filter(
    (name) => (name !== "edit" || mayEdit.value) && (name !== "room" || hasRoom.value),
  );
  const shown = tab.value ?? tabs[0]!;
  useEffect(
    () =>
      listenToDrops(() => {
        tab.value = "edit";
      }),
    [],
  );
  const open = (name: Tab): void => {
    tab.value = name;
  };
  return (
    <aside class="right" aria-label={said("Results")}>
      <Grip panel="right" name={said("Results")} />
      <div
        class="tabs"
        role="tablist"
        aria-label={said("Results")}
        onKeyDown={(event) => turn(event, tabs, shown, open)}
      >
        {tabs.map((name) => (
          <button
            key={name}
            type="button"
            role="tab"
            id={`tab-${name}`}
            aria-selected={shown === name}
            aria-controls="results"
            tabIndex={shown === name ? 0 : -1}
            onClick={() => open(name)}
          >
            {said(TITLES[name])}
            {name === "findings" && <FindingCount />}
          </button>
        ))}
      </div>
      <div class="tabpanel" id="results" role="tabpanel" aria-labelledby={`tab-${shown}`}>
        {shown === "edit" && <Editor />}
        {shown === "criteria" && <CriteriaTable />}
        {shown === "body" && <BodyMap />}
        {shown === "posture" && <Posture />}
        {shown === "room" && <Room />}
        {shown === "findings" && <Findings />}
      </div>
      <p class="disclaimer">{said("Evaluation of a model, to be confirmed by measurement.")}</p>
      <Splitter panel="right" name={said("Results")} />
    </aside>
  );
}

// Arrows go from tab to tab while the focus is on one; everywhere else time has them.
function turn(event: KeyboardEvent, tabs: readonly Tab[], shown: Tab, open: (name: Tab) => void): void {
  const at = tabs.indexOf(shown);
  const to: Record<string, number> = {
    ArrowRight: (at + 1) % tabs.length,
    ArrowLeft: (at + tabs.length - 1) % tabs.length,
    Home: 0,
    End: tabs.length - 1,
  };
  const next = to[event.key];
  if (next === undefined) return;
  open(tabs[next]!);
  (event.currentTarget as HTMLElement).querySelectorAll<HTMLElement>("[role=tab]")[next]?.focus();
  event.preventDefault();
  event.stopPropagation();
}

function FindingCount() {
  const findings = allFindings();
  const warnings = findings.filter((finding) => finding.level !== "note").length;
  const counts = said("{warnings} warnings and assumptions, {notes} notes", {
    warnings,
    notes: findings.length - warnings,
  });
  return (
    <>
      {" "}
      <span class={warnings > 0 ? "count count-warn" : "count"} title={counts}>
        {warnings > 0 ? `! ${findings.length}` : findings.length}
      </span>
    </>
  );
}
