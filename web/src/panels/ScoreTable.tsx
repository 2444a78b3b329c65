// Components of a score: left and right, each with its angles and the band that they fall into.

import { figure } from "../figures";
import { formatFixed } from "../format";
import { palette } from "../posture/coloring";
import { type Component, cssColor, scaleColor, shareOfScale, TOTAL } from "../posture/scores";
import { spoken } from "../units";
import type { Aspect, Row } from "../wire";
import { said } from "../words";

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
            <th scope="row">{part.name}</th>
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
  const scale = best === null ? "" : `, from ${best} to ${worst}`;
  return (
    <td colSpan={span} title={`${spoken(row.reason)}${scale}`}>
      <span class={share === null ? "chip chip-unknown" : "chip"} style={{ background: color }}>
        {share === null ? "?" : figure(row.value, "")}
        {worst !== null && share !== null && <small>/{worst}</small>}
      </span>
      <span class="angles">
        {share === null && <em>{spoken(row.reason || "not assessed")} </em>}
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
      ? "not measured"
      : angular
        ? `${formatFixed((aspect.value * 180) / Math.PI, 0)}°`
        : `${figure(aspect.value, aspect.unit)} ${aspect.unit}`;
  return (
    <span class="angle">
      {aspect.name} <b>{value}</b>
      {aspect.band && <small> {aspect.band}</small>}
    </span>
  );
}
