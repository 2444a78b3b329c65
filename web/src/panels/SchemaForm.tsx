// A form made of the schema of a table: what is there, what must be, and a choice of the rest. Tables within it, such
// as a shape, and lists, such as the corners of a field, are forms in it.

import { useSignal } from "@preact/signals";
import { useEffect, useId } from "preact/hooks";
import { asking, BEHIND, mistakesAt, named, names, type Path, refused, type Table } from "../editing/draft";
import { alternatives, type Field, fields, given, type Schema } from "../editing/schema";
import { said } from "../words";
import { FieldInput } from "./FieldInput";
import { MistakeList } from "./MistakeList";

/** What nearly everybody gives, where it may be given. */
const USUAL = new Set(["name", "limit"]);

/** What becomes of the value at a place below a table; `undefined` takes it away. */
export type Put = readonly [keys: Path, value: unknown];

/** A table with some of its values replaced, not changed in place. */
export function putInto(table: Table, puts: readonly Put[]): Table {
  const next = structuredClone(table);
  for (const [keys, value] of puts) {
    let inner = next as Record<string | number, unknown>;
    for (const key of keys.slice(0, -1)) {
      inner[key] ??= {};
      inner = inner[key] as typeof inner;
    }
    const last = keys.at(-1)!;
    if (last === BEHIND) (inner as unknown as unknown[]).push(value);
    else if (value === undefined) delete inner[last];
    else inner[last] = value;
  }
  return next;
}

interface FormProps {
  schema: Schema;
  table: Table;
  path: Path;
  /** Keys that stand elsewhere. */
  without?: readonly string[];
  /** Keys that are asked for, though the schema does not want them. */
  always?: readonly string[];
  onChange(puts: readonly Put[]): void;
}

/** An alternative that was chosen and that the table has not yet: what is typed of it, until it is accepted whole. */
interface Begun {
  bases: readonly string[];
  /** Keys of the alternatives that it takes the place of, which hold until then. */
  instead: readonly string[];
  table: Table;
}

export function SchemaForm({ schema, table: own, path, without = [], always = [], onChange }: FormProps) {
  const more = useSignal<ReadonlySet<string>>(new Set());
  const begun = useSignal<Begun | null>(null);
  const { bases: chosen, instead }: Omit<Begun, "table"> = begun.value ?? { bases: [], instead: [] };
  const kept = Object.entries(own).filter(([key]) => !instead.includes(key));
  const table: Table = { ...Object.fromEntries(kept), ...begun.value?.table };
  const groups = (schema["x-one-of"] ?? []).map((group, k) => ({
    group,
    ...alternatives(schema, own)[k]!,
  }));
  const accepted = groups.some(
    ({ group, chosen: at, keys }) => has(keys[at]) && group[at]!.every((base) => chosen.includes(base)),
  );
  useEffect(() => {
    if (accepted) begun.value = null;
  }, [accepted]);
  const all = fields(schema, table).filter((field) => !without.includes(field.name));
  const isAlternative = new Set(groups.flatMap(({ group }) => group.flat()));
  const shown = all.filter(
    (f) =>
      f.required ||
      f.name in table ||
      USUAL.has(f.name) ||
      always.includes(f.name) ||
      more.value.has(f.base) ||
      chosen.includes(f.base),
  );
  // Of a key that has no field here nobody else would say what is wrong with it.
  const beside = [...without, ...shown.map((field) => field.name)].flatMap((key) =>
    mistakesAt([...path, key]),
  );
  const others = mistakesAt(path).filter((m) => !beside.includes(m) && m.key !== named(path));
  const rest = all.filter((f) => !shown.includes(f) && !isAlternative.has(f.base));
  const put = (field: Field, puts: readonly Put[]): void => {
    const now = begun.value;
    if (!now?.bases.includes(field.base)) {
      onChange(puts);
      return;
    }
    // Of alternatives a table has one: what is given takes the others away, once it is given whole.
    const typed = putInto(now.table, puts);
    begun.value = { ...now, table: typed };
    if (fields(schema, typed).some(({ name, base }) => now.bases.includes(base) && !(name in typed))) return;
    onChange([
      ...now.instead.map((key): Put => [[key], undefined]),
      ...Object.entries(typed).map(([key, value]): Put => [[key], value]),
    ]);
  };
  const choose = (bases: string[], { group, chosen: at, keys }: (typeof groups)[number]): void => {
    begun.value = group[at] === bases ? null : { bases, instead: keys.flat(), table: {} };
  };
  return (
    <div class="form">
      <MistakeList mistakes={others} keys />
      {groups.map((one) => (
        <div class="field" key={one.group.flat().join(" ")}>
          <span class="one-of">{said("one of")}</span>
          <select
            aria-label={said("One of {keys}", { keys: one.group.map(([base]) => base).join(", ") })}
            value={
              one.group.find(([base]) => chosen.includes(base!))?.[0] ?? one.group[one.chosen]?.[0] ?? ""
            }
            onChange={(event) => {
              const bases = one.group.find(([base]) => base === event.currentTarget.value);
              if (bases) choose(bases, one);
            }}
          >
            <option value="" disabled>
              {said("choose …")}
            </option>
            {one.group.map(([base]) => (
              <option key={base} value={base}>
                {base}
              </option>
            ))}
          </select>
          {one.keys.flat().some((key) => instead.includes(key)) && (
            <p class="kind">
              {said("{old} holds until {new} is given", {
                old: one.keys.flat().join(", "),
                new: chosen.join(", "),
              })}
            </p>
          )}
        </div>
      ))}
      {shown.map((field) => (
        <FieldRow
          key={field.name}
          field={field}
          value={table[field.name]}
          path={path}
          onChange={(puts) => put(field, puts)}
        />
      ))}
      {rest.length > 0 && (
        <select
          aria-label={said("Another option")}
          value=""
          onChange={(event) => {
            more.value = new Set([...more.value, event.currentTarget.value]);
            event.currentTarget.value = "";
          }}
        >
          <option value="">{said("another option …")}</option>
          {rest.map((field) => (
            <option key={field.name} value={field.base}>
              {field.name}
            </option>
          ))}
        </select>
      )}
    </div>
  );
}

const has = (keys: readonly string[] | undefined): boolean => keys !== undefined && keys.length > 0;

interface RowProps {
  field: Field;
  value: unknown;
  path: Path;
  onChange(puts: readonly Put[]): void;
}

const isTable = (value: unknown): value is Table =>
  typeof value === "object" && value !== null && !Array.isArray(value);

function FieldRow({ field, value, path, onChange }: RowProps) {
  const { name, schema } = field;
  const own = [...path, name];
  const items = schema.items ? given(schema.items) : null;
  if (schema.properties && (value === undefined || isTable(value)))
    return (
      <NestedForm
        name={name}
        required={field.required}
        schema={schema}
        value={value}
        path={own}
        onChange={(puts) => onChange(puts.map(([keys, inner]) => [[name, ...keys], inner]))}
      />
    );
  if (
    items &&
    (items.properties || items.prefixItems) &&
    schema.type === "array" &&
    (value === undefined || Array.isArray(value))
  )
    return (
      <ListForm
        field={field}
        items={items}
        value={value ?? []}
        path={own}
        onChange={(puts) => onChange(puts.map(([keys, inner]) => [[name, ...keys], inner]))}
      />
    );
  return (
    <ValueRow field={field} value={value} path={own} onChange={(next) => onChange([[[field.name], next]])} />
  );
}

interface ValueProps {
  field: Field;
  value: unknown;
  /** Where the value itself is. */
  path: Path;
  onChange(next: unknown): void;
}

function ValueRow({ field, value, path, onChange }: ValueProps) {
  const id = useId();
  const now = JSON.stringify(value);
  /** What is wrong with what was typed, as long as the value is the one that stood there then. */
  const complaint = useSignal({ text: "", of: now });
  const wrong = complaint.value.of === now ? complaint.value.text : "";
  const mistakes = mistakesAt(path);
  const put = (next: unknown): void => {
    complaint.value = { text: "", of: now };
    // What is awaited may make it another value than this one.
    if (asking.peek() || JSON.stringify(next) !== now) onChange(next);
    else if (mistakes.length > 0) refused.value = null;
  };
  const bad = wrong !== "" || mistakes.length > 0;
  return (
    <div class="field" data-field={field.name}>
      <label for={id} title={field.about}>
        {field.name}
        {field.unit && <span class="unit"> [{field.unit}]</span>}
        {field.required && <span aria-hidden="true"> *</span>}
      </label>
      <FieldInput
        id={id}
        field={field}
        value={value}
        bad={bad}
        put={put}
        complain={(text) => {
          complaint.value = { text, of: now };
        }}
      />
      {wrong !== "" && <p class="mistake">{wrong}</p>}
      <MistakeList mistakes={mistakes} />
    </div>
  );
}

interface NestedProps {
  name: string;
  /** What is taken away with it; its name, unless that is a number. */
  what?: string;
  required: boolean;
  schema: Schema;
  /** `undefined` while the table has none: what is filled in is kept here until it is accepted. */
  value: Table | undefined;
  path: Path;
  onChange(puts: readonly Put[]): void;
}

function NestedForm({ name, what = name, required, schema, value, path, onChange }: NestedProps) {
  const begun = useSignal<Table>({});
  useEffect(() => {
    if (value !== undefined) begun.value = {};
  }, [value === undefined]);
  const here = mistakesAt(path).filter(({ key }) => key === named(path));
  return (
    // biome-ignore lint/a11y/useSemanticElements: a fieldset in a grid is lower than what is in it
    <div role="group" aria-label={name} class="nested" data-field={name}>
      <p class="nested-name">
        {name}
        {required && <span aria-hidden="true"> *</span>}
        {value !== undefined && !required && (
          <TakeAway what={what} onClick={() => onChange([[[], undefined]])} />
        )}
      </p>
      <MistakeList mistakes={here} />
      <SchemaForm
        schema={schema}
        table={value ?? begun.value}
        path={path}
        onChange={(puts) => {
          if (value !== undefined) return onChange(puts);
          begun.value = putInto(begun.value, puts);
          onChange([[[], begun.value]]);
        }}
      />
    </div>
  );
}

interface ListProps {
  field: Field;
  items: Schema;
  value: readonly unknown[];
  path: Path;
  onChange(puts: readonly Put[]): void;
}

function ListForm({ field, items, value, path, onChange }: ListProps) {
  const { name, unit, required } = field;
  /** Rows that the list has not: what is typed of them is kept until it is accepted; the last may be empty. */
  const begun = useSignal<readonly unknown[]>([]);
  const had = useSignal(value.length);
  useEffect(() => {
    if (value.length > had.value) {
      // Those that were asked for came first.
      const given = begun.value.filter((one) => one !== undefined).slice(value.length - had.value);
      begun.value = [...given, ...begun.value.filter((one) => one === undefined)];
    }
    had.value = value.length;
  }, [value.length]);
  const rows = [...value, ...begun.value];
  const here = mistakesAt(path).filter(({ key }) => key === named(path) || rowIn(key, path) >= rows.length);
  const whole = (next: unknown[]): void => onChange([[[], next.length > 0 || required ? next : undefined]]);
  const take = (k: number): void => {
    if (k < value.length) whole(value.filter((_, i) => i !== k));
    else begun.value = begun.value.filter((_, i) => i !== k - value.length);
  };
  const put = (k: number, puts: readonly Put[]): void => {
    if (puts.some(([keys, inner]) => keys.length === 0 && inner === undefined)) take(k);
    else if (k < value.length) onChange(puts.map(([below, inner]) => [[k, ...below], inner]));
    else {
      const next = putInto(
        { row: rows[k] },
        puts.map(([below, inner]): Put => [["row", ...below], inner]),
      ).row;
      begun.value = begun.value.map((one, i) => (i === k - value.length ? next : one));
      const given = begun.value.filter((one) => one !== undefined);
      // Tables that are there stay as they are written.
      if (items.properties && value.length > 0) onChange(given.map((one): Put => [[BEHIND], one]));
      else whole([...value, ...given]);
    }
  };
  const item = (k: number): Field => ({
    name: String(k + 1),
    base: String(k + 1),
    schema: items,
    required: false,
    unit: "",
    about: "",
  });
  return (
    // biome-ignore lint/a11y/useSemanticElements: a fieldset in a grid is lower than what is in it
    <div role="group" aria-label={name} class="nested" data-field={name}>
      <p class="nested-name" title={field.about}>
        {name}
        {unit && <span class="unit"> [{unit}]</span>}
        {required && <span aria-hidden="true"> *</span>}
      </p>
      <MistakeList mistakes={here} keys={here.some(({ key }) => key !== named(path))} />
      {rows.map((row, k) => (
        <div class="one-item" key={k}>
          {items.properties ? (
            <NestedForm
              name={String(k + 1)}
              what={`${name} ${k + 1}`}
              required={false}
              schema={items}
              value={row as Table | undefined}
              path={[...path, k]}
              onChange={(puts) => put(k, puts)}
            />
          ) : (
            <ValueRow
              field={item(k)}
              value={row}
              path={[...path, k]}
              onChange={(next) => put(k, [[[], next]])}
            />
          )}
          {(row === undefined || !items.properties) && (
            <TakeAway what={`${name} ${k + 1}`} onClick={() => take(k)} />
          )}
        </div>
      ))}
      <button
        type="button"
        class="small"
        aria-label={said("Add: {what}", { what: name })}
        onClick={() => {
          const next = field.schema["x-polygon"] ? between(value) : null;
          if (next) whole([...value, next]);
          else if (begun.value.at(-1) !== undefined || begun.value.length === 0)
            begun.value = [...begun.value, undefined];
        }}
      >
        +
      </button>
    </div>
  );
}

/** Which row of a list a mistake is about; -1 for none. */
function rowIn(key: string, path: Path): number {
  const start = named(path);
  return key.startsWith(start) ? Number(/^\[(\d+)\]/.exec(key.slice(start.length))?.[1] ?? -1) : -1;
}

function TakeAway({ what, onClick }: { what: string; onClick(): void }) {
  const name = said("Take away: {what}", { what });
  return (
    <button type="button" class="small" title={name} aria-label={name} onClick={onClick}>
      −
    </button>
  );
}

/** A corner between the last and the first of several, to be put to where it is wanted. */
function between(value: readonly unknown[]): number[] | null {
  const [first, last] = [value[0], value.at(-1)];
  if (!Array.isArray(first) || !Array.isArray(last) || value.length < 2) return null;
  return last.map((one: number, k) => Number(((one + Number(first[k])) / 2).toFixed(4)));
}

/** Names that a criterion may speak of, for the fields that ask for one. */
export function NameChoices() {
  return (
    <datalist id="names">
      {names.value.map((name) => (
        <option key={name} value={name} />
      ))}
    </datalist>
  );
}
