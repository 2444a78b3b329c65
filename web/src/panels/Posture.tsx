// Ergonomics: the scores of the posture by body part and side, when they were worst, and what that costs.

import { against, between } from "../figures";
import type { ToldResult } from "../messages";
import { frame, scene, stale } from "../page_state";
import { chooseScore, shownScore } from "../posture/coloring";
import { worstScores } from "../posture/instants";
import { components, scored } from "../posture/scores";
import { spoken } from "../units";
import { said } from "../words";
import { Instants } from "./Instants";
import { Parts } from "./Parts";
import { ColoringChoice, PaletteChoice } from "./ScoreColors";
import { ScoreTable } from "./ScoreTable";
import { StateBadge } from "./StateBadge";
import { TradeTable } from "./TradeTable";

export function Posture() {
  const run = scene.value;
  const judged = run?.criteria.filter((c) => c.group === "ergonomics") ?? [];
  if (!run || judged.length === 0) {
    return (
      <section class="posture scroll" aria-label={said("Posture")}>
        <p class="empty">
          {said("No ergonomics rule in this run. Add one to the workstation file, such as")}{" "}
          <code>[[ergonomics]] kind = "rula"</code>.
        </p>
      </section>
    );
  }
  const results = frame.value?.results ?? [];
  const withRows = scored(results);
  const result = results.find((r) => r.name === (shownScore.value ?? judged[0]?.name));
  return (
    <section class={`posture scroll ${stale.value ? "stale" : ""}`} aria-label={said("Posture")}>
      {withRows.length > 1 && (
        <div class="choice wide" role="tablist" aria-label={said("Score")}>
          {withRows.map(({ name }) => (
            <button
              key={name}
              type="button"
              role="tab"
              aria-selected={name === shownScore.value}
              onClick={() => chooseScore(name)}
            >
              {name}
            </button>
          ))}
        </div>
      )}
      {result ? (
        <Score result={result} />
      ) : (
        <p class="empty">{said("Nothing was said about the posture yet.")}</p>
      )}
      <div class="colors">
        <ColoringChoice />
        <PaletteChoice />
      </div>
      <WorstInstants />
      <TradeTable />
    </section>
  );
}

function Score({ result }: { result: ToldResult }) {
  const parts = components(result.rows);
  const figures = against(result.value, result.limit, result.unit, result.at_most);
  return (
    <div class="score">
      <p class="score-head">
        <strong class="score-value">{figures.value}</strong>
        {result.limit !== null && (
          <span class="unit">
            {result.at_most ? "≤" : "≥"} {figures.limit} {result.unit}
          </span>
        )}
        {result.verdict && <StateBadge state={result.verdict} />}
        {result.interval && (
          <span class="unit">
            {said("between {limits}", { limits: between(result.interval, result.unit) })}
          </span>
        )}
      </p>
      {result.reason !== "" && <p class="reason">{spoken(result.reason)}</p>}
      {parts.length > 0 ? (
        <ScoreTable parts={parts} />
      ) : (
        result.parts.length > 0 && <Parts parts={result.parts} />
      )}
    </div>
  );
}

function WorstInstants() {
  const all = worstScores.value.filter(({ instants }) => instants.length > 0);
  if (all.length === 0) return null;
  return (
    <div class="worst-instants">
      <h2>{said("Worst instants")}</h2>
      {all.map(({ info, instants }) => (
        <div key={info.name} class="instant-row">
          <span class="criterion-name">{info.name}</span>
          <Instants info={info} instants={instants} />
        </div>
      ))}
    </div>
  );
}
