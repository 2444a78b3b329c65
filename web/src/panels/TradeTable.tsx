// Posture against separation: the worst instants of either, and what the other says at the same time.

import { against } from "../figures";
import { formatTime } from "../format";
import { tradeColumns, tradeRows } from "../posture/instants";
import { STATE_ICONS, STATE_WORDS } from "../verdicts";
import type { CriterionInfo } from "../wire";
import { said } from "../words";
import { type Instant, verdictOf } from "../worst_instant";
import { useActions } from "./app_context";

export function TradeTable() {
  const { time } = useActions();
  const columns = tradeColumns.value;
  const rows = tradeRows.value;
  if (rows.length === 0 || !columns.some((c) => c.group !== "ergonomics")) return null;
  return (
    <div class="trade">
      <h2>{said("Posture against separation")}</h2>
      <div class="trade-scroll">
        <table>
          <thead>
            <tr>
              <th scope="col">{said("At")}</th>
              {columns.map(({ name, unit }) => (
                <th scope="col" key={name} class="number" title={name}>
                  {name}
                  {unit !== "" && <span class="unit"> {unit}</span>}
                </th>
              ))}
            </tr>
          </thead>
          <tbody>
            {rows.map((row) => (
              <tr key={row.t}>
                <th scope="row">
                  <button
                    type="button"
                    class="link"
                    title={said("Worst of {name}", { name: row.of })}
                    onClick={() => time.visit(row.t)}
                  >
                    {formatTime(row.t)}
                  </button>
                </th>
                {row.cells.map((cell, i) => (
                  <TradeCell key={columns[i]!.name} cell={cell} info={columns[i]!} of={row.of} />
                ))}
              </tr>
            ))}
          </tbody>
        </table>
      </div>
    </div>
  );
}

function TradeCell({ cell, info, of }: { cell: Instant | null; info: CriterionInfo; of: string }) {
  const verdict = cell && verdictOf(cell);
  return (
    <td class={`number ${verdict ? `state-${verdict}` : ""} ${info.name === of ? "own" : ""}`}>
      {verdict && <span aria-hidden="true">{STATE_ICONS[verdict]} </span>}
      {verdict && <span class="visually-hidden">{said(STATE_WORDS[verdict])} </span>}
      {against(cell?.value ?? null, cell?.limit ?? null, info.unit, info.at_most).value}
    </td>
  );
}
