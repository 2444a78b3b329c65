// A form made of the schema of a table: what is there, what must be, and a choice of the rest.

import { useSignal } from "@preact/signals";
import { useId } from "preact/hooks";
import { mistakesAt, named, names, type Path, type Table } from "../editing/draft";
import { type Field, fields, given, type Schema } from "../editing/schema";
import { said, word } from "../words";
import { MistakeList } from "./MistakeList";

/** What nearly everybody gives, where it may be given. */
const USUAL = new Set(["name", "limit"]);

interface FormProps {
  schema: Schema;
  table: Table;
  path: Path;
  /** Keys that stand elsewhere. */
  without?: readonly string[];
  /** Keys that are asked for, though the schema does not want them. */
  always?: readonly string[];
  /** `undefined` takes the key away. */
  onChange(key: string, value: unknown): void;
}

export function SchemaForm({ schema, table, path, without = [], always = [], onChange }: FormProps) {
  const more = useSignal<ReadonlySet<string>>(new Set());
  const all = fields(schema, table).filter((field) => !without.includes(field.name));
  const shown = all.filter(
    (f) =>
      f.required || f.name in table || USUAL.has(f.name) || always.includes(f.name) || more.value.has(f.name),
  );
  // Of a key that has no field here nobody else would say what is wrong with it.
  const beside = [...without, ...shown.map((field) => field.name)].flatMap((key) =>
    mistakesAt([...path, key]),
  );
  const others = mistakesAt(path).filter((m) => !beside.includes(m) && m.key !== named(path));
  const rest = all.filter((f) => !shown.includes(f));
  return (
    <div class="form">
      <MistakeList mistakes={others} keys />
      {shown.map((field) => (
        <FieldRow key={field.name} field={field} value={table[field.name]} path={path} onChange={onChange} />
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
            <option key={field.name} value={field.name}>
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
  onChange(key: string, value: unknown): void;
}

function FieldRow({ field, value, path, onChange }: RowProps) {
  const id = useId();
  const wrong = useSignal("");
  const mistakes = mistakesAt([...path, field.name]);
  const put = (next: unknown): void => {
    wrong.value = "";
    if (JSON.stringify(next) !== JSON.stringify(value)) onChange(field.name, next);
  };
  const bad = wrong.value !== "" || mistakes.length > 0;
  return (
    <div class="field" data-field={field.name}>
      <label for={id} title={field.about}>
        {field.name}
        {field.unit && <span class="unit"> [{field.unit}]</span>}
        {field.required && <span aria-hidden="true"> *</span>}
      </label>
      <Input
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

interface InputProps {
  id: string;
  field: Field;
  value: unknown;
  bad: boolean;
  put(value: unknown): void;
  complain(text: string): void;
}

function Input({ id, field, value, bad, put, complain }: InputProps) {
  const { schema, required } = field;
  const invalid = bad ? { "aria-invalid": true } : {};
  const choices = schema.enum ?? (schema.const === undefined ? null : [schema.const]);
  if (choices || schema.type === "boolean") {
    const list = choices?.map(String) ?? ["true", "false"];
    return (
      <select
        id={id}
        {...invalid}
        value={value === undefined ? "" : String(value)}
        onChange={(event) => {
          const text = event.currentTarget.value;
          put(text === "" ? undefined : choices ? choices[list.indexOf(text)] : text === "true");
        }}
      >
        <option value="">{said(required ? word("choose …") : word("not given"))}</option>
        {list.map((one) => (
          <option key={one} value={one}>
            {one}
          </option>
        ))}
      </select>
    );
  }
  const pair = schema.prefixItems?.map(given);
  if (pair && pair.length <= 3 && pair.every((one) => one.type === "string" || one.type === "number")) {
    const parts = Array.isArray(value) ? value : pair.map(() => "");
    return (
      <span class="parts">
        {pair.map((one, i) => (
          <input
            key={i}
            id={i === 0 ? id : undefined}
            aria-label={`${field.name} ${i + 1}`}
            {...invalid}
            list={one.type === "string" ? "names" : undefined}
            value={String(parts[i] ?? "")}
            onChange={(event) => {
              const text = event.currentTarget.value;
              const number = one.type === "number" && text !== "" && Number.isFinite(Number(text));
              const next = pair.map((_, k) => parts[k] ?? (one.type === "number" ? 0 : ""));
              next[i] = number ? Number(text) : text;
              put(next);
            }}
          />
        ))}
      </span>
    );
  }
  const isText = schema.type === "string";
  const isNumber = schema.type === "number" || schema.type === "integer";
  return (
    <input
      id={id}
      {...invalid}
      list={isText ? "names" : undefined}
      inputMode={isNumber ? "decimal" : undefined}
      placeholder={placeholder(field)}
      value={
        value === undefined
          ? ""
          : typeof value === "string" && (isText || !looksStructured(value))
            ? value
            : JSON.stringify(value)
      }
      onChange={(event) => {
        const text = event.currentTarget.value.trim();
        if (text === "") return put(undefined);
        if (isText) return put(text);
        try {
          put(JSON.parse(isNumber ? text.replace(",", ".") : text));
        } catch {
          // A quantity may also be a word, such as a percentile; lists and tables are written as JSON.
          if (/^[[{]/.test(text) || isNumber)
            complain(isNumber ? said("{text} is no number", { text }) : said("not JSON"));
          else put(text);
        }
      }}
    />
  );
}

const looksStructured = (text: string): boolean => /^[[{"\d-]/.test(text);

function placeholder({ schema, required }: Field): string {
  if (schema.default !== undefined && schema.default !== null && typeof schema.default !== "object")
    return String(schema.default);
  return required ? "" : said("not given");
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
