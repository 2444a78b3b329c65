// What is said of one area of the body: the verdict first, then what each limit allows and where it is from.

import { type Aspect, inputsOf, LOOK_WORDS, lookAt, lookOf, shareOf, type Told } from "../body_map/exposure";
import type { Spot } from "../body_map/figure";
import { against, atLeast, figure, percent, withUnit } from "../figures";
import { formatNumber } from "../format";
import { spoken } from "../units";
import type { Input, Scene } from "../wire";
import { said, told as words } from "../words";
import { ORIGINS } from "./BasisView";
import { StateBadge } from "./StateBadge";

/** Of constant height, so that the figures stay where they are while one points from area to area. */
export function ContactHead(props: {
  spot: Spot | undefined;
  told: Told | undefined;
  aspect: Aspect;
  /** Why nobody knows who can be hit; null where that is known. */
  open: string | null;
}) {
  const { spot, told, aspect, open } = props;
  if (!told) {
    return (
      <div class="contact-head">
        <h2>{spot ? said("area {n}", { n: spot.area }) : said("Whole body")}</h2>
        {open !== null && (
          <p class="contact-speed">
            <StateBadge state="undecided" />
          </p>
        )}
        <p class="reason">{open === null ? said("Nothing that moves is within reach.") : spoken(open)}</p>
      </div>
    );
  }
  const { row } = told;
  const look = lookAt(told, aspect, open !== null);
  const verdict = open !== null && row.verdict === "within" ? "undecided" : row.verdict;
  const side = row.side || (spot?.side ?? "");
  const share = shareOf(row, aspect);
  const figures = against(row.value, row.limit, row.unit, true);
  return (
    <div class={`contact-head card-${look}`}>
      <h2>
        {side !== "" && `${said(side)} `}
        {words(row.name)}
        <span class="unit">
          {row.areas.length > 0 && ` ${said("area {n}", { n: row.areas.join(", ") })}`}
          {row.group && row.group !== row.name && ` · ${words(row.group)}`}
        </span>
      </h2>
      <p class="contact-speed">
        {verdict && row.state !== "forbidden" ? <StateBadge state={verdict} /> : said(LOOK_WORDS[look])}
        {row.limit != null && (
          <span>
            {said("{value} of {limit}", { value: figures.value, limit: withUnit(figures.limit, row.unit) })}
          </span>
        )}
        {share !== null && <span>{percent(share, "up")}</span>}
      </p>
      <p class="reason">{spoken(open === null ? row.reason : `${open}; ${row.reason}`)}</p>
    </div>
  );
}

export function ContactDetails({ run, told }: { run: Scene; told: Told }) {
  const { row, criterion } = told;
  const inputs = inputsOf(told, run);
  return (
    <div class="contact-details">
      <dl>
        <dt>{said("Speed now")}</dt>
        <dd>{known(row.value, row.unit, figure)}</dd>
        <dt>{said("Permissible speed")}</dt>
        <dd>
          {row.limit == null ? said(LOOK_WORDS[lookOf(row, "worst")]) : known(row.limit, row.unit, atLeast)}
        </dd>
        {row.aspects.map((one) => (
          <AspectRow
            key={one.name}
            name={words(one.name)}
            text={words(one.band) || known(one.value, one.unit, atLeast)}
          />
        ))}
        <dt>{said("Criterion")}</dt>
        <dd>{criterion}</dd>
      </dl>
      {inputs.length > 0 && (
        <table class="inputs">
          <caption>{said("Limits, where from and how sure")}</caption>
          <tbody>
            {inputs.map((input) => (
              <LimitRow key={input.name} input={input} group={row.group} />
            ))}
          </tbody>
        </table>
      )}
    </div>
  );
}

function AspectRow({ name, text }: { name: string; text: string }) {
  return (
    <>
      <dt>{name}</dt>
      <dd>{text}</dd>
    </>
  );
}

function LimitRow({ input, group }: { input: Input; group: string }) {
  const value = typeof input.value === "number" ? formatNumber(input.value) : (input.value ?? "–");
  return (
    <tr>
      <th scope="row">{words(input.name.replace(`${group}: `, ""))}</th>
      <td class="number">
        {value} <span class="unit">{input.unit}</span>
      </td>
      <td>
        <span class={`origin origin-${input.origin}`}>{said(ORIGINS[input.origin] ?? input.origin)}</span>
        <span class="reason">{spoken(input.source)}</span>
      </td>
    </tr>
  );
}

function known(value: number | null | undefined, unit: string | undefined, written: typeof figure): string {
  return value == null ? said("not known") : withUnit(written(value, unit ?? ""), unit ?? "");
}
