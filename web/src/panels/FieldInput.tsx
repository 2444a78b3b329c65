// A value of one field: a choice, a number, a word, some numbers side by side, or what has no form of its own, as JSON.

import { type Field, given } from "../editing/schema";
import { list, listed, number, oneNumber, sideBySide, type Typed } from "../editing/typed";
import { said, word } from "../words";
import { TypedInput, TypedInputs } from "./TypedInput";

interface InputProps {
  id: string;
  field: Field;
  value: unknown;
  bad: boolean;
  put(value: unknown): void;
  complain(text: string): void;
}

/** Numbers that have room side by side. */
const MOST_PARTS = 6;

export function FieldInput({ id, field, value, bad, put, complain }: InputProps) {
  const { schema, required } = field;
  const take = (typed: Typed): void => ("wrong" in typed ? complain(typed.wrong) : put(typed.value));
  const choices = schema.enum ?? (schema.const === undefined ? null : [schema.const]);
  if (choices || schema.type === "boolean") {
    const list = choices?.map(String) ?? ["true", "false"];
    return (
      <select
        id={id}
        {...(bad && { "aria-invalid": true as const })}
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
  if (
    pair &&
    pair.length <= MOST_PARTS &&
    pair.every((one) => one.type === "string" || one.type === "number")
  ) {
    const parts = Array.isArray(value) ? value : [];
    const names = pair.map((_, i) => schema["x-parts"]?.[i] ?? String(i + 1));
    return (
      <span class="parts">
        <TypedInputs
          values={pair.map((_, i) => String(parts[i] ?? ""))}
          looks={pair.map((one, i) => ({
            id: i === 0 ? id : undefined,
            "aria-label": `${field.name} ${names[i]}`,
            title: schema["x-parts"]?.[i],
            list: one.type === "string" ? "names" : undefined,
          }))}
          bad={bad}
          onEntered={(texts) =>
            take(
              sideBySide(
                texts,
                pair.map(({ type }) => type === "number"),
                names,
              ),
            )
          }
        />
      </span>
    );
  }
  const each = schema.items ? given(schema.items).type : undefined;
  if (schema.type === "array" && (each === "number" || each === "integer" || each === "string"))
    return (
      <TypedInput
        id={id}
        bad={bad}
        placeholder={placeholder(field)}
        value={Array.isArray(value) ? listed(value) : ""}
        onEntered={(text) => take(list(text, each !== "string"))}
      />
    );
  const isText = schema.type === "string";
  const isNumber = schema.type === "number" || schema.type === "integer";
  return (
    <TypedInput
      id={id}
      bad={bad}
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
      onEntered={(typed) => {
        const text = typed.trim();
        if (isNumber || text === "") return take(oneNumber(text));
        if (isText) return put(text);
        // A quantity may also be a word, such as a percentile; lists and tables are written as JSON.
        const value = number(text);
        if (value !== null) return put(value);
        try {
          put(JSON.parse(text));
        } catch {
          if (/^[[{]/.test(text)) complain(said("not JSON"));
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
