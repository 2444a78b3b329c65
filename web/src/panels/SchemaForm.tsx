// A form made of the schema of a table: what is there, what must be, and a choice of the rest. Tables within it, such
// as a shape, and lists, such as the corners of a field, are forms in it.

import { useSignal } from "@preact/signals";
import { useId } from "preact/hooks";
import { mistakesAt, named, names, type Path, type Table } from "../editing/draft";
import { alternatives, example, type Field, fields, given, type Schema } from "../editing/schema";
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
    if (value === undefined) delete inner[last];
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

export function SchemaForm({ schema, table, path, without = [], always = [], onChange }: FormProps) {
  const more = useSignal<ReadonlySet<string>>(new Set());
  const all = fields(schema, table).filter((field) => !without.includes(field.name));
  const groups = (schema["x-one-of"] ?? []).map((group, k) => ({
    group,
    ...alternatives(schema, table)[k]!,
  }));
  const isAlternative = new Set(groups.flatMap(({ group }) => group.flat()));
  const shown = all.filter(
    (f) =>
      f.required || f.name in table || USUAL.has(f.name) || always.includes(f.name) || more.value.has(f.base),
  );
  // Of a key that has no field here nobody else would say what is wrong with it.
  const beside = [...without, ...shown.map((field) => field.name)].flatMap((key) =>
    mistakesAt([...path, key]),
  );
  const others = mistakesAt(path).filter((m) => !beside.includes(m) && m.key !== named(path));
  const rest = all.filter((f) => !shown.includes(f) && !isAlternative.has(f.base));
  /** Of alternatives a table has one: what is given takes the others away. */
  const put = (field: Field, puts: readonly Put[]): void => {
    const taken = groups
      .filter(({ group }) => group.flat().includes(field.base))
      .flatMap(({ group, keys }) => keys.filter((_, k) => !group[k]!.includes(field.base)).flat());
    onChange([...taken.map((key): Put => [[key], undefined]), ...puts]);
  };
  const choose = (group: string[][], bases: string[], keys: string[][]): void => {
    const values = bases.map((base): Put => [[base], example(schema, base)]);
    const others = [...more.value].filter((one) => !group.flat().includes(one));
    // What is begun with an example is shown once the file has it; what is not, to be filled in.
    if (values.every(([, value]) => value !== undefined)) {
      more.value = new Set(others);
      onChange([...keys.flat().map((key): Put => [[key], undefined]), ...values]);
    } else more.value = new Set([...others, ...bases]);
  };
  return (
    <div class="form">
      <MistakeList mistakes={others} keys />
      {groups.map(({ group, chosen, keys }) => (
        <div class="field" key={group.flat().join(" ")}>
          <span class="one-of">{said("one of")}</span>
          <select
            aria-label={said("One of {keys}", { keys: group.map(([base]) => base).join(", ") })}
            value={group[chosen]?.[0] ?? group.find(([base]) => more.value.has(base!))?.[0] ?? ""}
            onChange={(event) => {
              const bases = group.find(([base]) => base === event.currentTarget.value);
              if (bases) choose(group, bases, keys);
            }}
          >
            <option value="" disabled>
              {said("choose …")}
            </option>
            {group.map(([base]) => (
              <option key={base} value={base}>
                {base}
              </option>
            ))}
          </select>
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
  return <ValueRow field={field} value={value} path={path} onChange={onChange} />;
}

function ValueRow({ field, value, path, onChange }: RowProps) {
  const id = useId();
  const wrong = useSignal("");
  const mistakes = mistakesAt([...path, field.name]);
  const put = (next: unknown): void => {
    wrong.value = "";
    if (JSON.stringify(next) !== JSON.stringify(value)) onChange([[[field.name], next]]);
  };
  const bad = wrong.value !== "" || mistakes.length > 0;
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
          wrong.value = text;
        }}
      />
      {wrong.value !== "" && <p class="mistake">{wrong.value}</p>}
      <MistakeList mistakes={mistakes} />
    </div>
  );
}

interface NestedProps {
  name: string;
  required: boolean;
  schema: Schema;
  /** `undefined` while the table has none: what is filled in is kept here until it is accepted. */
  value: Table | undefined;
  path: Path;
  onChange(puts: readonly Put[]): void;
}

function NestedForm({ name, required, schema, value, path, onChange }: NestedProps) {
  const begun = useSignal<Table>({});
  const here = mistakesAt(path).filter(({ key }) => key === named(path));
  return (
    // biome-ignore lint/a11y/useSemanticElements: a fieldset in a grid is lower than what is in it
    <div role="group" aria-label={name} class="nested" data-field={name}>
      <p class="nested-name">
        {name}
        {required && <span aria-hidden="true"> *</span>}
        {value !== undefined && !required && (
          <TakeAway what={name} onClick={() => onChange([[[], undefined]])} />
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
  const adding = useSignal(false);
  const here = mistakesAt(path).filter(({ key }) => key === named(path));
  const whole = (next: unknown[]): void => {
    adding.value = false;
    onChange([[[], next.length > 0 || required ? next : undefined]]);
  };
  const item = (k: number): Field => ({
    name: String(k + 1),
    base: String(k + 1),
    schema: items,
    required: false,
    unit: "",
    about: "",
  });
  const count = value.length + (adding.value ? 1 : 0);
  return (
    // biome-ignore lint/a11y/useSemanticElements: a fieldset in a grid is lower than what is in it
    <div role="group" aria-label={name} class="nested" data-field={name}>
      <p class="nested-name" title={field.about}>
        {name}
        {unit && <span class="unit"> [{unit}]</span>}
        {required && <span aria-hidden="true"> *</span>}
      </p>
      <MistakeList mistakes={here} />
      {Array.from({ length: count }, (_, k) => (
        <div class="one-item" key={k}>
          {items.properties ? (
            <NestedForm
              name={String(k + 1)}
              required={false}
              schema={items}
              value={value[k] as Table | undefined}
              path={[...path, k]}
              onChange={(puts) => {
                const [[keys, inner]] = puts as [Put];
                if (k >= value.length) whole([...value, inner]);
                else if (keys.length === 0) whole(value.filter((_, i) => i !== k));
                else onChange(puts.map(([below, one]) => [[k, ...below], one]));
              }}
            />
          ) : (
            <ValueRow
              field={item(k)}
              value={value[k]}
              path={path}
              onChange={([put]) => {
                const next = [...value];
                if (put![1] === undefined) next.splice(k, 1);
                else next[k] = put![1];
                whole(next);
              }}
            />
          )}
          {k < value.length && !items.properties && (
            <TakeAway what={`${name} ${k + 1}`} onClick={() => whole(value.filter((_, i) => i !== k))} />
          )}
        </div>
      ))}
      <button
        type="button"
        class="small"
        aria-label={said("Add: {what}", { what: name })}
        onClick={() => {
          const next = between(value);
          if (next) whole([...value, next]);
          else adding.value = true;
        }}
      >
        +
      </button>
    </div>
  );
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
