// What is said: verdicts, contacts on the body, posture, and what to know of the model.

import { useSignal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { postureShown } from "../posture/coloring";
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
  useEffect(() => {
    postureShown.value = shown === "posture";
  }, [shown]);
  return (
    <aside class="right" aria-label="Results">
      <div class="tabs" role="tablist">
        {TABS.map((name) => (
          <button
            key={name}
            type="button"
            role="tab"
            aria-selected={shown === name}
            onClick={() => {
              tab.value = name;
            }}
          >
            {TITLES[name]}
            {name === "findings" && <FindingCount />}
          </button>
        ))}
      </div>
      {shown === "criteria" && <CriteriaTable />}
      {shown === "body" && <BodyMap />}
      {shown === "posture" && <Posture />}
      {shown === "findings" && <Findings />}
      <p class="disclaimer">Evaluation of a model, to be confirmed by measurement.</p>
    </aside>
  );
}

function FindingCount() {
  const findings = allFindings();
  const warnings = findings.filter((finding) => finding.level !== "note").length;
  return (
    <>
      {" "}
      <span class={warnings > 0 ? "count count-warn" : "count"}>
        {warnings > 0 ? `! ${findings.length}` : findings.length}
      </span>
    </>
  );
}
