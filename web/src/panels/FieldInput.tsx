// A value of one field: a choice, a number, a word, some numbers side by side, or what has no form of its own, as JSON.

import { type Field, given } from "../editing/schema";
import { said, word } from "../words";
import { TypedInput } from "./TypedInput";

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
  const invalid = bad ? { "aria-invalid": true as const } : {};
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
  if (
    pair &&
    pair.length <= MOST_PARTS &&
    pair.every((one) => one.type === "string" || one.type === "number")
  ) {
    const parts = Array.isArray(value) ? value : pair.map(() => "");
    return (
      <span class="parts">
        {pair.map((one, i) => (
          <TypedInput
            key={i}
            id={i === 0 ? id : undefined}
            aria-label={`${field.name} ${schema["x-parts"]?.[i] ?? i + 1}`}
            title={schema["x-parts"]?.[i]}
            {...invalid}
            list={one.type === "string" ? "names" : undefined}
            value={String(parts[i] ?? "")}
            onEntered={(_, input) => {
              // As they stand there: the file may not have what was entered into another one just now.
              const all = [...input.parentElement!.querySelectorAll("input")];
              put(all.map(({ value: text }, k) => entered(text.trim(), pair[k]!.type === "number")));
            }}
          />
        ))}
      </span>
    );
  }
  const each = schema.items ? given(schema.items).type : undefined;
  if (schema.type === "array" && (each === "number" || each === "string"))
    return (
      <TypedInput
        id={id}
        {...invalid}
        placeholder={placeholder(field)}
        value={Array.isArray(value) ? value.join(", ") : ""}
        onEntered={(text) => {
          const parts = text.split(/[[\],;\s]+/).filter((part) => part !== "");
          const wrong = parts.find((part) => each === "number" && !Number.isFinite(Number(part)));
          if (wrong !== undefined) return complain(said("{text} is no number", { text: wrong }));
          put(
            parts.length === 0 ? undefined : parts.map((part) => (each === "number" ? Number(part) : part)),
          );
        }}
      />
    );
  const isText = schema.type === "string";
  const isNumber = schema.type === "number" || schema.type === "integer";
  return (
    <TypedInput
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
      onEntered={(given) => {
        const text = given.trim();
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

/** A number where one is asked for, 0 while there is none; what else was typed is for the file's checks. */
function entered(text: string, number: boolean): unknown {
  if (!number) return text;
  return Number.isFinite(Number(text)) ? Number(text) : text;
}

const looksStructured = (text: string): boolean => /^[[{"\d-]/.test(text);

function placeholder({ schema, required }: Field): string {
  if (schema.default !== undefined && schema.default !== null && typeof schema.default !== "object")
    return String(schema.default);
  return required ? "" : said("not given");
}
