// The worst instants of a run, by score and by safety criterion, and what all of them say there.

import { computed, effect, signal, untracked } from "@preact/signals";
import { scene, traces, tracesRevision } from "../page_state";
import type { CriterionInfo } from "../wire";
import { heldAt, type Instant, worstInstants } from "../worst_instant";

/** Searched at most this often: a live run adds points many times a second. */
const SEARCH_MS = 1000;
const PER_CRITERION = 3;
const PER_SAFETY = 1;
/** What a posture is traded against. */
const SAFETY_KINDS: readonly string[] = ["separation", "minimum_distance", "power_and_force"];
const MOST_COLUMNS = 3;

export interface WorstOf {
  info: CriterionInfo;
  instants: Instant[];
}

export interface TradeRow {
  t: number;
  /** Whose worst instant it is. */
  of: string;
  cells: (Instant | null)[];
}

const searched = signal(0);
let searchedAt = Number.NEGATIVE_INFINITY;
let due: ReturnType<typeof setTimeout> | null = null;

effect(() => {
  void tracesRevision.value;
  if (due !== null) return;
  due = setTimeout(
    () => {
      due = null;
      searchedAt = performance.now();
      searched.value = untracked(() => searched.value) + 1;
    },
    Math.max(0, searchedAt + SEARCH_MS - performance.now()),
  );
});

/** Criteria of scores, with their worst instants. */
export const worstScores = computed<WorstOf[]>(() => {
  const scores = scene.value?.criteria.filter((info) => info.group === "ergonomics") ?? [];
  return scores.map((info) => ({ info, instants: worstOf(info) }));
});

/** The worst instants of a criterion; read inside a component or an effect, they are kept up to date. */
export function worstOf(info: CriterionInfo): Instant[] {
  void searched.value;
  const trace = traces.get(info.name);
  return trace ? worstInstants(trace, info.at_most, PER_CRITERION) : [];
}

/** Columns of the trade-off: every score, and the first few of what says how near the robot is. */
export const tradeColumns = computed<CriterionInfo[]>(() => {
  const criteria = scene.value?.criteria ?? [];
  const safety = criteria.filter((info) => SAFETY_KINDS.includes(info.kind)).slice(0, MOST_COLUMNS);
  return [...criteria.filter((info) => info.group === "ergonomics").slice(0, MOST_COLUMNS), ...safety];
});

/** The worst instants of the columns in order of time, with what every column says there. */
export const tradeRows = computed<TradeRow[]>(() => {
  void searched.value;
  const columns = tradeColumns.value;
  const rows: TradeRow[] = [];
  for (const info of columns) {
    const trace = traces.get(info.name);
    const count = info.group === "ergonomics" ? 2 : PER_SAFETY;
    for (const { t } of trace ? worstInstants(trace, info.at_most, count) : []) {
      if (rows.some((row) => row.t === t)) continue;
      const cells = columns.map(({ name }) => {
        const other = traces.get(name);
        return other ? heldAt(other, t) : null;
      });
      rows.push({ t, of: info.name, cells });
    }
  }
  return rows.sort((a, b) => a.t - b.t);
});
