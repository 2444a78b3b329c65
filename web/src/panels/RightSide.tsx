// What is said: verdicts, contacts on the body, posture, and what to know of the model.

import { useSignal } from "@preact/signals";
import { BodyMap } from "./BodyMap";
import { CriteriaTable } from "./CriteriaTable";
import { allFindings, Findings } from "./Findings";
import { Posture } from "./Posture";

const TABS = ["criteria", "body", "posture", "findings"] as const;
type Tab = (typeof TABS)[number];

const TITLES: Record<Tab, string> = {
  criteria: "Criteria",
  body: "Body",
  posture: "Posture",
  findings: "Findings",
};

export function RightSide() {
  const tab = useSignal<Tab>("criteria");
  const shown = tab.value;
  const open = (name: Tab): void => {
    tab.value = name;
  };
  return (
    <aside class="right" aria-label="Results">
      <div class="tabs" role="tablist" aria-label="Results" onKeyDown={(event) => turn(event, shown, open)}>
        {TABS.map((name) => (
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
            {TITLES[name]}
            {name === "findings" && <FindingCount />}
          </button>
        ))}
      </div>
      <div class="tabpanel" id="results" role="tabpanel" aria-labelledby={`tab-${shown}`}>
        {shown === "criteria" && <CriteriaTable />}
        {shown === "body" && <BodyMap />}
        {shown === "posture" && <Posture />}
        {shown === "findings" && <Findings />}
      </div>
      <p class="disclaimer">Evaluation of a model, to be confirmed by measurement.</p>
    </aside>
  );
}

// Arrows go from tab to tab while the focus is on one; everywhere else time has them.
function turn(event: KeyboardEvent, shown: Tab, open: (name: Tab) => void): void {
  const at = TABS.indexOf(shown);
  const to: Record<string, number> = {
    ArrowRight: (at + 1) % TABS.length,
    ArrowLeft: (at + TABS.length - 1) % TABS.length,
    Home: 0,
    End: TABS.length - 1,
  };
  const next = to[event.key];
  if (next === undefined) return;
  open(TABS[next]!);
  (event.currentTarget as HTMLElement).querySelectorAll<HTMLElement>("[role=tab]")[next]?.focus();
  event.preventDefault();
  event.stopPropagation();
}

function FindingCount() {
  const findings = allFindings();
  const warnings = findings.filter((finding) => finding.level !== "note").length;
  const said = `${warnings} warnings and assumptions, ${findings.length - warnings} notes`;
  return (
    <>
      {" "}
      <span class={warnings > 0 ? "count count-warn" : "count"} title={said}>
        {warnings > 0 ? `! ${findings.length}` : findings.length}
      </span>
    </>
  );
}
