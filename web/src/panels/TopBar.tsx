// What is shown, from where, and the worst that is said about it.

import { against, withUnit } from "../figures";
import { elsewhere, frame, hello, isLive, link, lookingAt, overall, rows, scene, stale } from "../page_state";
import { orderedRows } from "../row_order";
import { STATE_ICONS, type State } from "../verdicts";
import type { Result } from "../wire";
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
        {run && <span class="edition">{run.edition || "no edition stated"}</span>}
      </div>
      <HeadsetOffer />
      <SourceState />
      <StatusPill />
    </header>
  );
}

function SourceState() {
  const { state, reason } = link.value;
  const lost = state !== "open";
  const words = {
    connecting: "connecting…",
    lost: "disconnected – trying again",
    refused: "refused",
    open: isLive.value ? (stale.value ? "live – nothing heard" : "live") : "replay",
  }[state];
  const look = lost || stale.value ? "off" : isLive.value ? "live" : "replay";
  return (
    <div class={`source source-${look}`} title={lost ? reason : (hello.value?.server ?? "")} role="status">
      <span class="dot" aria-hidden="true" />
      {words}
      {lost && reason !== "" && <span class="source-reason">{reason}</span>}
    </div>
  );
}

const HEADLINES: Record<State, string> = {
  exceeded: "LIMIT EXCEEDED",
  undecided: "UNDECIDED",
  missing: "UNDECIDED",
  close: "WITHIN LIMITS, CLOSE",
  within: "WITHIN LIMITS",
  none: "NO LIMITS SET",
};

/**
 * The worst verdict, and the criterion that gives it. Grey as soon as it may be out of date; it speaks of
 * the instant on screen, and says so where a recording is, or a live run was, worse at another.
 */
function StatusPill() {
  const state = overall.value;
  if (stale.value || !frame.value) {
    return (
      <output class="pill state-off" aria-live="polite">
        <span class="badge-icon" aria-hidden="true">
          –
        </span>
        <strong>NO CURRENT DATA</strong>
      </output>
    );
  }
  const there = orderedRows.value.filter((row) => row.state === state);
  const worst = there[0];
  const others = there.length - 1;
  const other = elsewhere.value;
  const detail = worst && state !== "within" && state !== "none" ? ` ${worst.info.name}` : "";
  return (
    <output class={`pill state-${state}`} aria-live="polite">
      <span class="badge-icon" aria-hidden="true">
        {STATE_ICONS[state]}
      </span>
      <strong>
        {HEADLINES[state]}
        {other && isLive.value && lookingAt.value === null && " NOW"}
      </strong>
      {detail && (
        <span class="pill-detail" title={worst?.info.name}>
          {detail}
        </span>
      )}
      {worst?.result && detail && worst.result.value !== null && (
        <span class="pill-value" aria-hidden="true">
          {pillFigure(worst.result)}
        </span>
      )}
      {other && <ElsewhereNote other={other} />}
      {!detail && !other && state !== "none" && (
        <span class="pill-more">all {judgedCount()} with a limit</span>
      )}
      {detail && others > 0 && <span class="pill-more">+{others}</span>}
      {lookingAt.value !== null && <span class="pill-more">looking back</span>}
    </output>
  );
}

function pillFigure({ value, limit, unit, at_most }: Result): string {
  return withUnit(against(value, limit, unit, at_most).value, unit);
}

function judgedCount(): number {
  return rows.value.filter((row) => row.state !== "none").length;
}
