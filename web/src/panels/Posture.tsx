// Ergonomics: the scores of the posture by body part and side, when they were worst, and what that costs.

import { formatNumber, formatTime } from "../format";
import { frame, scene, stale } from "../page_state";
import { chooseScore, coloring, palette, shownScore } from "../posture/coloring";
import { worstScores } from "../posture/instants";
import {
  type Coloring,
  components,
  cssColor,
  PALETTES,
  type Palette,
  scaleColor,
  scored,
} from "../posture/scores";
import type { Result } from "../wire";
import { useActions } from "./app_context";
import { ScoreTable } from "./ScoreTable";
import { StateBadge } from "./StateBadge";
import { TradeTable } from "./TradeTable";

const COLORINGS: readonly [Coloring, string][] = [
  ["parts", "Body parts"],
  ["overall", "Overall"],
  ["verdict", "Verdicts"],
];

export function Posture() {
  const run = scene.value;
  const judged = run?.criteria.filter((c) => c.group === "ergonomics") ?? [];
  if (!run || judged.length === 0) {
    return (
      <section class="posture scroll" aria-label="Posture">
        <p class="empty">
          No ergonomics rule in this run. Add one to the workstation file, such as{" "}
          <code>[[ergonomics]] kind = "rula"</code>.
        </p>
      </section>
    );
  }
  const results = frame.value?.results ?? [];
  const withRows = scored(results);
  const result = results.find((r) => r.name === (shownScore.value ?? judged[0]?.name));
  return (
    <section class={`posture scroll ${stale.value ? "stale" : ""}`} aria-label="Posture">
      {withRows.length > 1 && (
        <div class="choice wide" role="tablist" aria-label="Score">
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
      {result ? <Score result={result} /> : <p class="empty">Nothing was said about the posture yet.</p>}
      <Colors />
      <WorstInstants />
      <TradeTable />
    </section>
  );
}

function Score({ result }: { result: Result }) {
  const parts = components(result.rows);
  return (
    <div class="score">
      <p class="score-head">
        <strong class="score-value">{formatNumber(result.value, 100)}</strong>
        {result.limit !== null && (
          <span class="unit">
            {result.at_most ? "≤" : "≥"} {formatNumber(result.limit, 100)}
          </span>
        )}
        {result.verdict && <StateBadge state={result.verdict} />}
        {result.interval && (
          <span class="unit">
            between {formatNumber(result.interval[0], 100)} and {formatNumber(result.interval[1], 100)}
          </span>
        )}
      </p>
      {result.reason !== "" && <p class="reason">{result.reason}</p>}
      {parts.length > 0 ? <ScoreTable parts={parts} /> : <PlainParts result={result} />}
    </div>
  );
}

// A rule that has no rows by body part still says its parts.
function PlainParts({ result }: { result: Result }) {
  if (result.parts.length === 0) return null;
  return (
    <table class="parts">
      <tbody>
        {result.parts.map((part) => (
          <tr key={part.name}>
            <th scope="row">
              {part.name}
              {part.reason !== "" && <span class="reason">{part.reason}</span>}
            </th>
            <td class="number">{formatNumber(part.value, 100)}</td>
          </tr>
        ))}
      </tbody>
    </table>
  );
}

function Colors() {
  const steps = [0, 0.25, 0.5, 0.75, 1];
  return (
    <div class="colors">
      <fieldset class="choice">
        <legend>Colour the manikin by</legend>
        {COLORINGS.map(([key, title]) => (
          <button
            key={key}
            type="button"
            aria-pressed={coloring.value === key}
            onClick={() => {
              coloring.value = key;
            }}
          >
            {title}
          </button>
        ))}
      </fieldset>
      <label class="scale-choice">
        <span class="scale" aria-hidden="true">
          {steps.map((share) => (
            <i key={share} style={{ background: cssColor(scaleColor(share, palette.value)) }} />
          ))}
        </span>
        <select
          aria-label="Colours from the best to the worst score"
          value={palette.value}
          onChange={(event) => {
            palette.value = event.currentTarget.value as Palette;
          }}
        >
          {PALETTES.map((name) => (
            <option key={name} value={name}>
              {name}
            </option>
          ))}
        </select>
      </label>
    </div>
  );
}

function WorstInstants() {
  const { time } = useActions();
  const all = worstScores.value.filter(({ instants }) => instants.length > 0);
  if (all.length === 0) return null;
  return (
    <div class="worst-instants">
      <h3>Worst instants</h3>
      {all.map(({ info, instants }) => (
        <div key={info.name} class="instant-row">
          <span class="criterion-name">{info.name}</span>
          {instants.map((instant, i) => (
            <button
              key={instant.t}
              type="button"
              class="jump"
              title={`Go to ${formatTime(instant.t)}`}
              data-worst={i === 0 ? info.name : undefined}
              onClick={() => time.visit(instant.t)}
            >
              <strong>{formatNumber(Number.isNaN(instant.value) ? null : instant.value, 100)}</strong>{" "}
              {formatTime(instant.t)}
            </button>
          ))}
        </div>
      ))}
    </div>
  );
}
