// What the page knows, as signals: one selection, one time cursor, one set of results for every panel.

import { batch, computed, signal } from "@preact/signals";
import { type Elsewhere, worseElsewhere } from "./elsewhere";
import type { Frame, LinkState, ToldResult } from "./messages";
import { Trace } from "./traces";
import { type State, stateOf, worstState } from "./verdicts";
import type { CriterionInfo, Hello, Node, Registered, Scene, SoFar, Tracked, Transport } from "./wire";

export interface Selection {
  /** `node` and `criterion` name one thing; `owner` a whole robot, human, tool or part. */
  kind: "node" | "owner" | "criterion";
  name: string;
}

/** A row of the criteria table: what the criterion is and what it says now. */
export interface Row {
  info: CriterionInfo;
  result: ToldResult | null;
  state: State;
}

export interface Link {
  state: LinkState;
  reason: string;
}

export const link = signal<Link>({ state: "connecting", reason: "" });
export const hello = signal<Hello | null>(null);
export const scene = signal<Scene | null>(null);
export const transport = signal<Transport>({
  type: "transport",
  playing: false,
  t: 0,
  speed: 1,
  live: false,
  loop: false,
});

/** What became of what this page's headset sees; null before it offered anything. */
export const tracked = signal<Tracked | null>(null);

/** What the server said last of where the room of this page's headset lies; null before it said anything. */
export const registered = signal<Registered | null>(null);

/** What the run came to by now, or as far as the recording was read; null where nobody says. */
export const soFar = signal<SoFar | null>(null);

/** Shown results and joints; replaced at most ten times a second. */
export const frame = signal<Frame | null>(null);
/** Run time of what is shown [s], in memory: a picture changes it, and a signal would keep each value as an object. */
export const shownAt = new Float64Array([Number.NaN]);
/** The time cursor: run time of what is shown [s]; whoever follows it hears of it with each frame. */
export const now = {
  get value() {
    void frame.value;
    return shownAt[0]!;
  },
  peek: () => shownAt[0]!,
};
/** Run time that the numbers on the screen are of [s]; the cursor is ahead of it by less than one can read. */
export const clock = computed(() => frame.value?.t ?? Number.NaN);
/** Whether numbers on screen are older than they should be: no connection, or nothing heard. */
export const stale = signal(true);
/** While live, the run time being looked at; null when following. */
export const lookingAt = signal<number | null>(null);
/** Run times that can be shown [s]. */
export const reach = signal<{ start: number; end: number }>({ start: 0, end: 0 });

export const selection = signal<Selection | null>(null);
/** Nodes that are not drawn. */
export const hidden = signal<ReadonlySet<string>>(new Set());
/** Whether the twin is shown over the real cell: what is real is not drawn there, and hides what is behind it. */
export const overReality = signal(false);
/** Criteria whose markers are not drawn. */
export const mutedCriteria = signal<ReadonlySet<string>>(new Set());

/** Traces are changed in place; the revision says so. */
export const traces = new Map<string, Trace>();
export const tracesRevision = signal(0);
/** Traces of another run, on the same axis, and what it is called; empty without one. */
export const besideTraces = new Map<string, Trace>();
export const besideTitle = signal("");
/** Why the one that was asked for is not there, and those that can be. */
export const besideRefusal = signal("");
export const otherRuns = signal<readonly string[]>([]);

/** Whether this page may play, pause and seek; a live run can be held back in any page. */
export const mayControl = computed(() => isLive.value || (hello.value?.may.includes("control") ?? false));
/** Whether this page may offer what a headset sees. */
export const mayTrack = computed(() => hello.value?.may.includes("track") ?? false);

export const isLive = computed(() => hello.value?.mode === "live");

export const rows = computed<Row[]>(() => {
  const infos = scene.value?.criteria ?? [];
  const results = new Map(frame.value?.results.map((r) => [r.name, r]));
  return infos.map((info) => {
    const result = results.get(info.name) ?? null;
    // A limit that nothing was said about must not look like one that is kept.
    const state = result ? stateOf(result) : "missing";
    return { info, result, state };
  });
});

/** The worst of all; `missing` until something was heard. */
export const overall = computed<State>(() => {
  if (!frame.value) return "missing";
  return worstState(rows.value.map((row) => row.state));
});

/** What a recording holds at other times, or a live run held so far, that is worse than what is shown. */
export const elsewhere = computed<Elsewhere | null>(() => {
  // Traces are changed in place: only the revision tells.
  if (tracesRevision.value < 0) return null;
  return worseElsewhere(traces.values(), overall.value);
});

/** What the run came to: never better than what is on screen, or than what the page knows of other times. */
export const runState = computed<State>(() => {
  const known: State[] = [overall.value];
  if (elsewhere.value) known.push(elsewhere.value.verdict);
  if (soFar.value) known.push(soFar.value.verdict ?? "none");
  const worst = worstState(known);
  return worst === "close" ? "within" : worst;
});

/** For so long after the run fell behind it is said to be falling [s of run time]. */
const FALLS_S = 3;

/** How much later than real time a live run is [s], and whether it falls behind just now; null when it never did. */
export const behind = computed<{ lost: number; now: boolean } | null>(() => {
  const told = soFar.value;
  if (!told || told.slipped <= 0) return null;
  return { lost: told.slipped, now: reach.value.end - (told.slipped_at ?? 0) < FALLS_S };
});

/** Nodes of the selection, by full name. */
export const selectedNodes = computed<ReadonlySet<string>>(() => {
  const chosen = selection.value;
  const nodes = scene.value?.nodes ?? [];
  if (!chosen) return new Set();
  if (chosen.kind === "node") return new Set([chosen.name]);
  const names = chosen.kind === "owner" ? [chosen.name] : subjectsOf(chosen.name);
  return new Set(nodes.filter((n) => names.some((name) => belongs(n, name))).map((n) => n.name));
});

export function subjectsOf(criterion: string): readonly string[] {
  return scene.value?.criteria.find((c) => c.name === criterion)?.subjects ?? [];
}

function belongs(node: Node, name: string): boolean {
  return node.name === name || node.owner === name || node.name.startsWith(`${name}/`);
}

export function select(next: Selection | null): void {
  selection.value = next;
}

export function toggleHidden(names: readonly string[]): void {
  hidden.value = toggled(hidden.value, names);
}

export function toggleMuted(criterion: string): void {
  mutedCriteria.value = toggled(mutedCriteria.value, [criterion]);
}

// All of them are put in unless all are in already.
function toggled(set: ReadonlySet<string>, names: readonly string[]): ReadonlySet<string> {
  const next = new Set(set);
  const remove = names.every((name) => next.has(name));
  for (const name of names) {
    if (remove) next.delete(name);
    else next.add(name);
  }
  return next;
}

/** A new scene: what belonged to another one is forgotten, the rest is kept over a reconnection. */
export function beginScene(next: Scene): void {
  batch(() => {
    // What is edited is called as before; another run is another run.
    if (scene.value?.workstation_hash !== next.workstation_hash && !hello.value?.may.includes("edit")) {
      selection.value = null;
      hidden.value = new Set();
      mutedCriteria.value = new Set();
    }
    scene.value = next;
    soFar.value = null;
    shownAt[0] = Number.NaN;
    frame.value = null;
    lookingAt.value = null;
    traces.clear();
    besideTraces.clear();
    besideTitle.value = "";
    besideRefusal.value = "";
    otherRuns.value = [];
    for (const { name } of next.criteria) traces.set(name, new Trace(name));
    tracesRevision.value += 1;
  });
}
