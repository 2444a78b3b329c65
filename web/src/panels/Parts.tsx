// What a result says of each of its parts: a link, a body area, a side.

import { against, withUnit } from "../figures";
import type { ToldResult } from "../messages";
import { spoken } from "../units";
import { said } from "../words";
import { StateBadge } from "./StateBadge";

export function Parts({ parts }: { parts: readonly ToldResult[] }) {
  return (
    <table class="parts">
      <caption>{said("Parts")}</caption>
      <tbody>
        {parts.map((part) => (
          <Part key={part.name} part={part} />
        ))}
      </tbody>
    </table>
  );
}

function Part({ part }: { part: ToldResult }) {
  const { value, limit } = against(part.value, part.limit, part.unit, part.at_most);
  return (
    <tr>
      <th scope="row">
        {spoken(part.name)}
        {part.reason !== "" && <span class="reason">{spoken(part.reason)}</span>}
      </th>
      <td class="number">{withUnit(value, part.unit)}</td>
      <td class="number">{part.limit !== null && withUnit(limit, part.unit)}</td>
      <td>{part.verdict && <StateBadge state={part.verdict} />}</td>
    </tr>
  );
}
