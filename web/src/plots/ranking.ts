// Which criteria come first where there is no room for all: those that were exceeded at some time, then
// those with a limit, then those that only inform; each in the file's order, so that little ever moves.

import { besideTraces, traces } from "../page_state";
import type { CriterionInfo } from "../wire";

export function ranked(criteria: readonly CriterionInfo[]): CriterionInfo[] {
  return [...criteria].sort((a, b) => rank(a) - rank(b));
}

/** Whether a limit was ever given, or a verdict ever made, also in a run beside. */
export function isJudged(info: CriterionInfo): boolean {
  return info.limit !== null || [traces, besideTraces].some((each) => each.get(info.name)?.judged);
}

function rank(info: CriterionInfo): number {
  const trace = traces.get(info.name);
  if (trace?.exceeded) return 0;
  return info.limit !== null || trace?.limited ? 1 : 2;
}
