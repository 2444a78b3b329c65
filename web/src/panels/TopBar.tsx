// What is shown, from where, and what the run came to.

import { ownDevice } from "../company";
import { notRun, onTrial } from "../editing/draft";
import { against, percent, withUnit } from "../figures";
import type { ToldResult } from "../messages";
import {
  behind,
  elsewhere,
  frame,
  hello,
  isLive,
  link,
  lookingAt,
  overall,
  rows,
  runState,
  scene,
  soFar,
  stale,
} from "../page_state";
import { orderedRows } from "../row_order";
import { STATE_ICONS, STATE_WORDS, type State } from "../verdicts";
import { said, told, word } from "../words";
import { Company } from "./Company";
import { ElsewhereNote } from "./ElsewhereNote";
import { HeadsetOffer } from "./HeadsetOffer";

export function TopBar() {
  const run = scene.value;
  return (
    <header class="topbar">
      <div class="brand">
        <img src="/icon.svg" alt="" width="22" height="22" />
        <span>seerob</span>
      </div>
      <div class="study">
        <h1 title={run?.title}>{run?.title ?? "…"}</h1>
        {run && <span class="edition">{run.edition ? told(run.edition) : said("no edition stated")}</span>}
      </div>
      <Company />
      <HeadsetOffer />
      <SourceState />
      {ownDevice.value === "desk" && <StatusPill />}
    </header>
  );
}

function SourceState() {
  const { state, reason } = link.value;
  const lost = state !== "open";
  const words = {
    connecting: said("connecting…"),
    lost: said("disconnected – trying again"),
    refused: said("refused"),
    open: notRun.value
      ? said("editing")
      : isLive.value
        ? stale.value
          ? said("live – nothing heard")
          : [
              said("live"),
              onTrial.value && said("a draft, not recorded"),
              behind.value && said("behind real time"),
            ]
              .filter(Boolean)
              .join(" – ")
        : said("replay"),
  }[state];
  const look = lost || stale.value ? "off" : !isLive.value ? "replay" : behind.value?.now ? "slow" : "live";
  const why = behind.value?.now
    ? said(
        "The run falls behind real time: this machine is too slow for the workstation, or was suspended. What is heard meanwhile is late, and what rests on it undecided.",
      )
    : (hello.value?.server ?? "");
  const late = !lost && !notRun.value && !stale.value && isLive.value ? behind.value : null;
  return (
    <div class={`source source-${look}`} title={lost ? reason : why}>
      <span class="dot" aria-hidden="true" />
      <span role="status">{words}</span>
      {/* Not read anew at each tenth of a second. */}
      {late && <span>{said("by {s} s", { s: (Math.ceil(10 * late.lost) / 10).toFixed(1) })}</span>}
      {lost && reason !== "" && <span class="source-reason">{reason}</span>}
    </div>
  );
}

const HEADLINES: Record<State, string> = {
  exceeded: word("LIMIT EXCEEDED"),
  undecided: word("UNDECIDED"),
  missing: word("UNDECIDED"),
  close: word("WITHIN LIMITS, CLOSE"),
  within: word("WITHIN LIMITS"),
  none: word("NO LIMITS SET"),
};

/**
 * The verdict of the run, so far; beside it that of the instant on screen, and the criterion that gives it.
 * Grey as soon as it may be out of date.
 */
function StatusPill() {
  if (stale.value || !frame.value) {
    return (
      <output class="pill state-off" aria-live="polite">
        <span class="badge-icon" aria-hidden="true">
          –
        </span>
        <strong>{said("NO CURRENT DATA")}</strong>
      </output>
    );
  }
  if (notRun.value) {
    return (
      <output class="pill state-none" aria-live="polite">
        <span class="badge-icon" aria-hidden="true">
          –
        </span>
        <strong>{said("NOT RUN")}</strong>
        <AtInstant />
      </output>
    );
  }
  const run = runState.value;
  const other = elsewhere.value;
  const told = soFar.value;
  return (
    <output class={`pill state-${run}`} aria-live="polite">
      <span class="badge-icon" aria-hidden="true">
        {STATE_ICONS[run]}
      </span>
      <strong>
        {said(HEADLINES[run])}
        {told?.whole !== true && ` ${said("SO FAR")}`}
        {onTrial.value && `, ${said("DRAFT")}`}
      </strong>
      {run === "within" && (
        <span class="pill-more">{said("all {n} with a limit", { n: judgedCount() })}</span>
      )}
      {run === "within" && told?.decided != null && told.decided < 1 && (
        <span class="pill-more">
          {said("decided")} {percent(told.decided)}
        </span>
      )}
      <AtInstant />
      {other && <ElsewhereNote other={other} />}
      {lookingAt.value !== null && <span class="pill-more">{said("looking back")}</span>}
    </output>
  );
}

/** What holds at the instant on screen. */
function AtInstant() {
  const state = overall.value;
  const there = orderedRows.value.filter((row) => row.state === state);
  const worst = there[0];
  const named = worst && state !== "within" && state !== "none";
  const when = notRun.value
    ? said("at the start")
    : isLive.value && lookingAt.value === null
      ? said("now")
      : said("here");
  return (
    <span class={`pill-now now-${state}`}>
      {when} <span aria-hidden="true">{STATE_ICONS[state]}</span> {said(STATE_WORDS[state])}
      {named && (
        <span class="pill-detail" title={worst.info.name}>
          {` ${worst.info.name}`}
        </span>
      )}
      {named && worst.result && worst.result.value !== null && (
        <span class="pill-value" aria-hidden="true">
          {` ${pillFigure(worst.result)}`}
        </span>
      )}
      {named && there.length > 1 && <span class="pill-more"> +{there.length - 1}</span>}
    </span>
  );
}

function pillFigure({ value, limit, unit, at_most }: ToldResult): string {
  return withUnit(against(value, limit, unit, at_most).value, unit);
}

function judgedCount(): number {
  return rows.value.filter((row) => row.state !== "none").length;
}
