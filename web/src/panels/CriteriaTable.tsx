// The verdicts: a real table, worst first, every number with its unit and its basis.

import { useSignal } from "@preact/signals";
import { Fragment } from "preact";
import { against, between, gap, percent, steady, withUnit } from "../figures";
import { formatTime } from "../format";
import type { ToldResult } from "../messages";
import { mutedCriteria, type Row, scene, select, selection, soFar, stale, toggleMuted } from "../page_state";
import { worstOf } from "../posture/instants";
import { aim, orderedRows } from "../row_order";
import { shownIn, spoken } from "../units";
import { margin, STATE_WORDS } from "../verdicts";
import type { CriterionInfo } from "../wire";
import { said, told, word } from "../words";
import { BasisView } from "./BasisView";
import { Icon } from "./Icon";
import { Instants } from "./Instants";
import { Parts } from "./Parts";
import { StateBadge } from "./StateBadge";

const COLUMNS = 4;
/** A name with more characters stands above its figures: beside them it would make a tower. */
const LONGEST_BESIDE = 34;

export function CriteriaTable() {
  const opened = useSignal<string | null>(null);
  const toggle = (name: string): void => {
    const opening = opened.value !== name;
    opened.value = opening ? name : null;
    select(opening ? { kind: "criterion", name } : null);
  };
  return (
    <section class="criteria scroll" aria-label={said("Criteria")}>
      <table class={stale.value ? "stale" : ""}>
        <colgroup>
          <col />
          <col class="col-value" />
          <col class="col-limit" />
          <col class="col-state" />
        </colgroup>
        <thead>
          <tr>
            <th scope="col">{said("Criterion")}</th>
            <th scope="col" class="number">
              {said("Value")}
            </th>
            <th scope="col" class="number">
              {said("Limit")}
            </th>
            <th scope="col" class="state">
              {said("State")}
            </th>
          </tr>
        </thead>
        <tbody onPointerMove={() => aim(true)} onPointerLeave={() => aim(false)}>
          {orderedRows.value.map((row) => (
            <Fragment key={row.info.name}>
              <CriterionRow
                row={row}
                open={opened.value === row.info.name}
                onToggle={() => toggle(row.info.name)}
              />
              {opened.value === row.info.name && (
                <tr class="details">
                  <td colSpan={COLUMNS}>
                    <Details row={row} />
                  </td>
                </tr>
              )}
            </Fragment>
          ))}
        </tbody>
      </table>
      {scene.value?.criteria.length === 0 && (
        <p class="empty">{said("This workstation file has no criteria: nothing is judged.")}</p>
      )}
    </section>
  );
}

function CriterionRow({ row, open, onToggle }: { row: Row; open: boolean; onToggle: () => void }) {
  const { info, result, state } = row;
  const chosen = selection.value?.kind === "criterion" && selection.value.name === info.name;
  const long = info.name.length > LONGEST_BESIDE;
  const limit = result ? result.limit : info.limit;
  const unit = result?.unit ?? info.unit;
  const figures = against(result?.value ?? null, limit, unit, info.at_most);
  const reason =
    result?.reason ?? (state === "missing" ? said("nothing was said about it in this snapshot") : "");
  const shown = stale.value && state !== "missing" ? "off" : state;
  const look = `row-${shown} ${chosen ? "selected" : ""}`;
  return (
    <>
      {long && (
        <tr class={`row named explained ${look}`}>
          <Name row={row} open={open} onToggle={onToggle} wide />
        </tr>
      )}
      <tr
        class={`row ${look} ${reason === "" ? "" : "explained"}`}
        data-criterion={info.name}
        title={hint(row)}
      >
        {long ? <td class="blank" /> : <Name row={row} open={open} onToggle={onToggle} />}
        <td class="number">
          <span class="value">{steady(figures.value, unit)}</span>{" "}
          <span class="unit">{shownIn(unit).unit}</span>
          {result && <Usage result={result} />}
        </td>
        <td class="number limit">
          {limit === null ? (
            "–"
          ) : (
            <>
              <span class="bound" title={said(info.at_most ? word("at most") : word("at least"))}>
                {info.at_most ? "≤" : "≥"}
              </span>{" "}
              {figures.limit} <span class="unit">{shownIn(unit).unit}</span>
            </>
          )}
          {result && limit !== null && (
            <span class="margin" title={said("Left to the limit; negative is beyond it")}>
              {leftOf(result)}
            </span>
          )}
        </td>
        <td class="state">
          <StateBadge state={state} />
          {result?.t !== null && result?.t !== undefined && (
            <span class="instant">{said("at {time}", { time: formatTime(result.t) })}</span>
          )}
        </td>
      </tr>
      {reason !== "" && (
        <tr class={`row explanation ${look}`}>
          <td colSpan={COLUMNS}>
            <span class="reason">{spoken(reason)}</span>
          </td>
        </tr>
      )}
    </>
  );
}

interface NameProps {
  row: Row;
  open: boolean;
  onToggle: () => void;
  wide?: boolean;
}

function Name({ row: { info }, open, onToggle, wide = false }: NameProps) {
  const muted = mutedCriteria.value.has(info.name);
  return (
    <th scope="row" colSpan={wide ? COLUMNS : 1}>
      <button type="button" class={`twist ${open ? "open" : ""}`} aria-expanded={open} onClick={onToggle}>
        <Icon name="chevron" />
        <span class="criterion-name">{info.name}</span>
      </button>
      <button
        type="button"
        class={`eye ${muted ? "off" : ""}`}
        aria-label={said(muted ? word("Show markers of {name}") : word("Hide markers of {name}"), {
          name: info.name,
        })}
        onClick={() => toggleMuted(info.name)}
      >
        <Icon name={muted ? "eye-off" : "eye"} />
      </button>
    </th>
  );
}

/** How much of the limit is used; the tick is the limit. */
function Usage({ result }: { result: ToldResult }) {
  const { value, limit, at_most } = result;
  if (value === null || limit === null || !(limit > 0)) return null;
  const full = at_most ? 1.25 : 2;
  const share = (x: number): string => `${(Math.min(Math.max(x / limit, 0), full) / full) * 100}%`;
  return (
    <span class="usage" aria-hidden="true">
      <i style={{ width: share(value) }} />
      <b style={{ left: share(limit) }} />
    </span>
  );
}

// A share of the limit; of a limit that is zero there is none, so the difference itself.
function leftOf(result: ToldResult): string {
  const share = margin(result);
  if (share !== null || result.value === null || result.limit === null) return percent(share);
  return withUnit(gap(result.value, result.limit, result.unit, result.at_most), result.unit);
}

function WorstInstants({ info }: { info: CriterionInfo }) {
  const instants = worstOf(info);
  if (instants.length === 0) return null;
  return (
    <div class="instant-row">
      <span class="unit">{said("Worst instants")}</span>
      <Instants info={info} instants={instants} />
    </div>
  );
}

function hint({ info }: Row): string {
  const { basis } = info;
  return basis ? `${told(info.title)}\n${told(basis.formula)}\n${told(basis.source)}` : told(info.title);
}

/** What the whole run came to, and of which share of it that speaks. */
function RunSoFar({ info }: { info: CriterionInfo }) {
  const known = soFar.value?.criteria[info.name];
  if (!known) return null;
  const shares: [number, string][] = [
    [known.decided, word("decided")],
    [known.undecided, word("undecided")],
    [known.open, word("not asked")],
    [known.muted, word("did not apply")],
    [known.nothing, word("nothing to judge")],
  ];
  const parts = shares
    .filter(([share]) => share > 0)
    .map(([share, what]) => `${said(what)} ${percent(share)}`);
  return (
    <p class="run-so-far">
      {said(soFar.value?.whole ? word("Run") : word("Run so far"))}:{" "}
      {said(known.verdict ? STATE_WORDS[known.verdict] : word("no verdict"))};{" "}
      {said("{shares} of the time", { shares: parts.join(", ") })}
      {known.reason !== "" && `; ${spoken(known.reason)}`}
    </p>
  );
}

function Details({ row }: { row: Row }) {
  const { info, result } = row;
  return (
    <div class="details-body">
      <p class="lead">{told(info.title)}</p>
      {result?.interval && (
        <p>
          {said("True value between {limits}, given the tolerances of the inputs.", {
            limits: between(result.interval, result.unit),
          })}
        </p>
      )}
      <RunSoFar info={info} />
      <WorstInstants info={info} />
      {result && result.parts.length > 0 && <Parts parts={result.parts} />}
      {info.basis ? <BasisView basis={info.basis} /> : <p class="unknown">{said("No basis was stated.")}</p>}
    </div>
  );
}
