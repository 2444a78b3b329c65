// Components of a score: left and right, each with its angles and the band that they fall into.

import { figure } from "../figures";
import { formatFixed } from "../format";
import { palette } from "../posture/coloring";
import { type Component, cssColor, scaleColor, shareOfScale, TOTAL } from "../posture/scores";
import { spoken } from "../units";
import type { Aspect, Row } from "../wire";
import { said, told, word } from "../words";

export function ScoreTable({ parts }: { parts: readonly Component[] }) {
  return (
    <table class="scores">
      <thead>
        <tr>
          <th scope="col">{said("Component")}</th>
          <th scope="col">{said("Left")}</th>
          <th scope="col">{said("Right")}</th>
        </tr>
      </thead>
      <tbody>
        {parts.map((part) => (
          <tr key={part.name} class={part.name === TOTAL ? "total" : ""}>
            <th scope="row">{part.name === TOTAL ? said("score") : told(part.name)}</th>
            {part.left || part.right ? (
              <>
                <ScoreCell row={part.left} />
                <ScoreCell row={part.right} />
              </>
            ) : (
              <ScoreCell row={part.middle} span={2} />
            )}
          </tr>
        ))}
      </tbody>
    </table>
  );
}

function ScoreCell({ row, span = 1 }: { row: Row | null; span?: number }) {
  if (!row) return <td colSpan={span}>–</td>;
  const share = shareOfScale(row);
  const color = share === null ? undefined : cssColor(scaleColor(share, palette.value));
  const [best, worst] = row.scale ?? [null, null];
  const scale = best === null || worst === null ? "" : said("from {best} to {worst}", { best, worst });
  return (
    <td colSpan={span} title={[spoken(row.reason), scale].filter((text) => text !== "").join(", ")}>
      <span class={share === null ? "chip chip-unknown" : "chip"} style={{ background: color }}>
        {share === null ? "?" : figure(row.value, "")}
        {worst !== null && share !== null && <small>/{worst}</small>}
      </span>
      <span class="angles">
        {share === null && <em>{row.reason === "" ? said("not assessed") : spoken(row.reason)} </em>}
        {row.aspects.map((aspect) => (
          <Angle key={aspect.name} aspect={aspect} />
        ))}
      </span>
    </td>
  );
}

function Angle({ aspect }: { aspect: Aspect }) {
  const angular = aspect.unit === "rad";
  const value =
    aspect.value == null
      ? said("not measured")
      : angular
        ? `${formatFixed((aspect.value * 180) / Math.PI, 0)}°`
        : `${figure(aspect.value, aspect.unit)} ${aspect.unit}`;
  return (
    <span class="angle">
      {told(aspect.name)} <b>{value}</b>
      {aspect.band && <small> {band(aspect.band)}</small>}
    </span>
  );
}

/** The band of an angle in words: the engine says `below 20°`, `20° to 45°` or `beyond 45°`. */
function band(text: string): string {
  const one = /^(below|beyond) (\S+)$/.exec(text);
  if (one)
    return said(one[1] === "below" ? word("below {angle}") : word("beyond {angle}"), { angle: one[2]! });
  const two = /^(\S+) to (\S+)$/.exec(text);
  return two ? said("{low} to {high}", { low: two[1]!, high: two[2]! }) : told(text);
}
