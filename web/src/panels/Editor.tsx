// The workstation file, edited: what is selected, where it is, what else is said of it, and what there may be more.

import { useSignal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import {
  ask,
  asking,
  change,
  changeTo,
  chosenEntry,
  draft,
  type Entry,
  entries,
  freeName,
  isCriteria,
  isPlaced,
  mistakesAt,
  named,
  type Path,
  refused,
  type Table,
} from "../editing/draft";
import { gizmoMode, lengthUnit, STEP_NAMES, STEPS, steps } from "../editing/handles";
import { moveTo, placing, poseKey, setNumber, tidy } from "../editing/pose";
import { entrySchema, fetchSchema, kinds, schema } from "../editing/schema";
import { select } from "../page_state";
import type { Change } from "../wire";
import { said, word } from "../words";
import { AddWaypoint } from "./AddWaypoint";
import { Bringing } from "./Bringing";
import { Choice } from "./Choice";
import { MistakeList } from "./MistakeList";
import { Review } from "./Review";
import { NameChoices, putInto, SchemaForm } from "./SchemaForm";
import { TypedInput } from "./TypedInput";

const GROUPS: readonly [group: string, title: string, one: string][] = [
  ["robots", word("Robots"), word("robot")],
  ["parts", word("Parts"), word("part")],
  ["areas", word("Areas"), word("area")],
  ["sensors", word("Sensors"), word("sensor")],
  ["humans", word("People"), word("person")],
  ["machines", word("Machines"), word("machine")],
  ["tools", word("Tools"), word("tool")],
  ["workpieces", word("Workpieces"), word("workpiece")],
  ["waypoints", word("Waypoints"), word("waypoint")],
  ["safety", word("Safety criteria"), word("safety criterion")],
  ["ergonomics", word("Ergonomics"), word("ergonomics rule")],
];
/** How far a copy stands from what it is a copy of [m]. */
const ASIDE = 0.5;
/** How far one of a waypoint stands above it, along the z of its frame [m]. */
const ABOVE = 0.05;

export function Editor() {
  useEffect(() => void fetchSchema(), []);
  const adding = useSignal<string | null>(null);
  const reviewing = useSignal(false);
  const now = draft.value;
  if (!now) return <p class="empty">{said("The server has not said what the file has.")}</p>;
  const entry = chosenEntry.value;
  const changedLines = now.diff.split("\n").filter((line) => /^[+-](?![+-]{2})/.test(line)).length;
  return (
    <section class="editor scroll" aria-label={said("Edit")}>
      <NameChoices />
      <div class="edit-bar">
        <button type="button" disabled={!now.undo} title="Ctrl+Z" onClick={() => void ask("undo")}>
          {said("Undo")}
        </button>
        <button type="button" disabled={!now.redo} title="Ctrl+Y" onClick={() => void ask("redo")}>
          {said("Redo")}
        </button>
        <button
          type="button"
          class="primary"
          disabled={now.diff === ""}
          onClick={() => {
            reviewing.value = true;
          }}
        >
          {said("Review and save")}
          {changedLines > 0 && ` (${changedLines})`}
        </button>
        <button
          type="button"
          title={said(
            now.runs
              ? word("End the run: everybody is shown where they begin")
              : word("Run the draft from its beginning; every edit begins it anew, and nothing is recorded"),
          )}
          onClick={() => void ask(now.runs ? "stop" : "run")}
        >
          {said(now.runs ? word("Stop") : word("Run"))}
        </button>
        <span role="status">
          {said(asking.value ? word("checking …") : now.diff === "" ? word("saved") : word("not saved"))}
        </span>
      </div>
      {now.runs && (
        <p class="trial">
          {said(
            "The draft is run, from its beginning with every edit: time, motions, connections and what criteria counted. Nothing is recorded.",
          )}
        </p>
      )}
      {now.ended !== "" && (
        <p class="trial" role="alert">
          {said("The run has ended: {why}", { why: now.ended })}
        </p>
      )}
      <div class="edit-bar">
        <select
          aria-label={said("What is edited")}
          value={entry ? `${entry.group} ${entry.index}` : ""}
          onChange={(event) => {
            adding.value = null;
            choose(event.currentTarget.value);
          }}
        >
          <option value="">{said("select something …")}</option>
          {GROUPS.map(([group, title]) => {
            const own = entries.value.filter((e) => e.group === group);
            return (
              own.length > 0 && (
                <optgroup key={group} label={said(title)}>
                  {own.map((e) => (
                    <option key={e.index} value={`${group} ${e.index}`}>
                      {e.name}
                    </option>
                  ))}
                </optgroup>
              )
            );
          })}
        </select>
        <select
          aria-label={said("Add")}
          value=""
          onChange={(event) => {
            adding.value = event.currentTarget.value || null;
            refused.value = null;
            event.currentTarget.value = "";
          }}
        >
          <option value="">{said("add …")}</option>
          {GROUPS.map(([group, , one]) => (
            <option key={group} value={group}>
              {said(one)}
            </option>
          ))}
        </select>
      </div>
      <Refusal path={adding.value ? placeOfNew(adding.value) : (entry?.path ?? null)} />
      {adding.value === "waypoints" ? (
        <AddWaypoint
          close={() => {
            adding.value = null;
          }}
        />
      ) : adding.value ? (
        <Adding
          key={adding.value}
          group={adding.value}
          close={() => {
            adding.value = null;
          }}
        />
      ) : entry ? (
        <EntryForm key={`${entry.group} ${entry.index}`} entry={entry} />
      ) : (
        <p class="empty">{said("Select something in the room, the tree or above, or add something.")}</p>
      )}
      <Bringing />
      <Review
        open={reviewing.value}
        close={() => {
          reviewing.value = false;
        }}
      />
    </section>
  );
}

// A waypoint belongs to a source, which may have to come with it.
const placeOfNew = (group: string): Path => (group === "waypoints" ? ["sources"] : [group, count(group)]);
const count = (group: string): number => entries.value.filter((e) => e.group === group).length;

function choose(value: string): void {
  const [group, index] = value.split(" ");
  const found = entries.value.find((e) => e.group === group && e.index === Number(index));
  if (found) select({ kind: isCriteria(found.group) ? "criterion" : "owner", name: found.name });
  else select(null);
}

/** What was refused and is not beside a field that is shown. */
function Refusal({ path }: { path: Path | null }) {
  const last = refused.value;
  if (!last) return null;
  const beside = path ? mistakesAt(path) : [];
  const start = path ? named(path) : "";
  const elsewhere = last.mistakes.filter((m) => !beside.includes(m) || m.key === start);
  const removed = last.changes[0]?.kind === "remove" && typeof last.changes[0].path.at(-1) === "number";
  const others = removed ? speakers(last.mistakes.map(({ key }) => key)) : [];
  return (
    <div class="refusal" role="alert">
      <p>
        {said("Refused; nothing was changed")}
        {elsewhere.length < last.mistakes.length && `: ${said("see below")}`}
      </p>
      <MistakeList mistakes={elsewhere} keys />
      {others.length > 0 && (
        <button
          type="button"
          onClick={() => void change(...removals([...others, ...last.changes.map((c) => c.path)]))}
        >
          {said("Remove with {others}", { others: others.map(named).join(", ") })}
        </button>
      )}
    </div>
  );
}

function speakers(keys: readonly string[]): Path[] {
  const found = new Map<string, Path>();
  for (const key of keys) {
    const at = key.match(/^(\w+)\[(\d+)\]/);
    if (at) found.set(at[0], [at[1]!, Number(at[2])]);
  }
  return [...found.values()];
}

// The last of a list first: the numbers of those before it stay.
function removals(paths: Path[]): Change[] {
  const once = new Map(paths.map((path) => [named(path), path]));
  return [...once.values()]
    .sort((a, b) => Number(b[1]) - Number(a[1]))
    .map((path) => ({ kind: "remove", path, value: null }));
}

function EntryForm({ entry }: { entry: Entry }) {
  const { group, path, table, name } = entry;
  const form = schema.value ? entrySchema(group, table) : null;
  const at = poseKey(entry);
  const copy = async (): Promise<void> => {
    const other = freeName(name);
    const point = group === "waypoints";
    const value: Table = point ? {} : { name: other };
    if (at !== null && isPlaced(group)) {
      const { position } = placing(entry);
      if (point) position.z += ABOVE;
      else position.x += ASIDE;
      const shifted = moveTo(entry, position, null);
      const pose = (table[at] ?? {}) as Table;
      const [one] = shifted;
      if (one)
        value[at] = table[at] === undefined ? one.value : { ...pose, [String(one.path.at(-1))]: one.value };
    }
    if (point) {
      // Behind the last of its source, to be dragged to where it is wanted.
      const { name: _, ...rest } = table;
      await change({ kind: "add", path: path.slice(0, -1), value: { ...rest, ...value } });
      return;
    }
    if (await change({ kind: "copy", path, value }))
      select({ kind: isCriteria(group) ? "criterion" : "owner", name: other });
  };
  return (
    <div class="entry" data-entry={named(path)}>
      <h2>{name}</h2>
      {typeof table.kind === "string" && <p class="kind">{table.kind}</p>}
      {at !== null && <PlaceForm entry={entry} at={at} />}
      {form ? (
        <SchemaForm
          schema={form}
          table={table}
          path={path}
          without={at === null ? [] : [at]}
          onChange={(puts) =>
            void ask("change", () => puts.flatMap(([keys, value]) => changeTo([...path, ...keys], value)))
          }
        />
      ) : (
        <>
          <MistakeList mistakes={mistakesAt(path)} keys />
          <p class="empty">
            {schema.value ? said("A kind of your own: edit its options in the file.") : "…"}
          </p>
        </>
      )}
      <div class="edit-bar">
        <button type="button" onClick={() => void copy()}>
          {said("Copy")}
        </button>
        <button type="button" onClick={() => void change({ kind: "remove", path, value: null })}>
          {said("Remove")}
        </button>
      </div>
    </div>
  );
}

const AXES = ["x", "y", "z"] as const;
const TURNS = ["roll", "pitch", "yaw"] as const;

function PlaceForm({ entry, at }: { entry: Entry; at: string }) {
  const place = placing(entry);
  const scale = lengthUnit.value === "mm" ? 1000 : 1;
  const [length, angle] = STEPS[steps.value];
  // Of the entry as it is when it is asked: two angles typed at once are both kept.
  const put = (changes: (now: Entry) => Change[]): void =>
    void ask("change", () => {
      const now = entries.value.find((one) => named(one.path) === named(entry.path));
      return now ? changes(now) : [];
    });
  return (
    <fieldset class="place">
      <legend>
        {said("Place")}
        {typeof entry.table.on === "string" && (
          <span class="unit"> {said("on {name}", { name: entry.table.on })}</span>
        )}
      </legend>
      <div class="numbers">
        {AXES.map((axis, k) => (
          <NumberField
            key={axis}
            name={axis}
            unit={lengthUnit.value}
            value={tidy(place.position.getComponent(k) * scale, 6)}
            step={(length || 0.001) * scale}
            put={(value) => put((now) => setNumber(now, "position", k, value / scale))}
          />
        ))}
        {TURNS.map((turn, k) => (
          <NumberField
            key={turn}
            name={turn}
            unit="°"
            value={place.rpy[k]!}
            step={angle || 1}
            put={(value) => put((now) => setNumber(now, "rpy", k, value))}
          />
        ))}
      </div>
      <MistakeList mistakes={mistakesAt([...entry.path, at])} />
      <div class="edit-bar">
        <Choice name={said("Handles")} choices={["move", "turn"] as const} chosen={gizmoMode} title={said} />
        <Choice
          name={said("Steps")}
          choices={STEP_NAMES}
          chosen={steps}
          title={(one) => (STEPS[one][0] ? `${STEPS[one][0] * 1000} mm, ${STEPS[one][1]}°` : said("none"))}
        />
        <Choice name={said("Unit")} choices={["m", "mm"] as const} chosen={lengthUnit} />
      </div>
    </fieldset>
  );
}

interface NumberProps {
  name: string;
  unit: string;
  value: number;
  step: number;
  put(value: number): void;
}

function NumberField({ name, unit, value, step, put }: NumberProps) {
  const id = `place-${name}`;
  return (
    <label for={id}>
      {name} <span class="unit">[{unit}]</span>
      <TypedInput
        id={id}
        type="number"
        step={step}
        value={String(value)}
        // What is no number, or refused, is not what the file has.
        onEntered={(_, { valueAsNumber }) => {
          if (Number.isFinite(valueAsNumber)) put(valueAsNumber);
        }}
      />
    </label>
  );
}

// Shapes and fields to begin with; figures that a verdict rests on are left to whoever adds it.
const BEGIN: Record<string, () => Table> = {
  robots: () => ({ name: freeName("robot"), model: "library:ur5e", base: { position: [0, 0, 0] } }),
  parts: () => ({ name: freeName("part"), shape: { box: [0.5, 0.5, 0.5] }, at: { position: [0, 0, 0.25] } }),
  areas: () => ({ name: freeName("area"), shape: { box: [1, 1, 2] }, at: { position: [0, 0, 1] } }),
  sensors: () => ({
    name: freeName("scanner"),
    at: { position: [0, 0, 0.3] },
    // What its data sheet says is typed, angles in degrees; the corners of its field are seen in the room.
    laser_scanner: {
      range: "",
      angle_deg: "",
      resolution_deg: "",
      fields: [
        {
          name: "protective",
          corners: [
            [0, -1],
            [2, -1],
            [2, 1],
            [0, 1],
          ],
        },
      ],
    },
  }),
  humans: () => ({ name: freeName("person"), at: { position: [1.5, 0, 0] } }),
};

function Adding({ group, close }: { group: string; close: () => void }) {
  const table = useSignal<Table>(
    BEGIN[group]?.() ?? (isPlaced(group) ? { name: freeName(group.slice(0, -1)) } : {}),
  );
  const choices = schema.value ? kinds(group) : [];
  const form =
    schema.value && (choices.length === 0 || table.value.kind) ? entrySchema(group, table.value) : null;
  const path: Path = [group, count(group)];
  const add = async (): Promise<void> => {
    if (!(await change({ kind: "add", path: [group], value: table.value }))) return;
    close();
    const added = entries.value.filter((e) => e.group === group).at(-1);
    if (added) select({ kind: isCriteria(group) ? "criterion" : "owner", name: added.name });
  };
  return (
    <div class="entry adding" data-entry={named(path)}>
      <h2>{said("Add: {what}", { what: said(GROUPS.find(([name]) => name === group)![2]) })}</h2>
      {choices.length > 0 && (
        <label>
          kind{" "}
          <select
            value={String(table.value.kind ?? "")}
            onChange={(event) => {
              table.value = { kind: event.currentTarget.value };
            }}
          >
            <option value="">{said("choose …")}</option>
            {choices.map(([kind, about]) => (
              <option key={kind} value={kind} title={about}>
                {kind}
              </option>
            ))}
          </select>
        </label>
      )}
      {form?.description && <p class="kind">{form.description}</p>}
      {form && (
        <SchemaForm
          schema={form}
          table={table.value}
          path={path}
          onChange={(puts) => {
            table.value = putInto(table.value, puts);
          }}
        />
      )}
      <div class="edit-bar">
        <button type="button" class="primary" disabled={!form || asking.value} onClick={() => void add()}>
          {said("Add")}
        </button>
        <button type="button" onClick={close}>
          {said("Cancel")}
        </button>
      </div>
    </div>
  );
}
