// What somebody types into a field, read: numbers with a point or a comma, several of them, and lists of words.

import { said } from "../words";

/** What was typed: a value, `undefined` where nothing stands; or what is wrong with it. */
export type Typed = { value: unknown } | { wrong: string };

const NUMBER = /^[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?$/i;

/** A number, with a point or a comma before its decimals; null for what is none. */
export function number(text: string): number | null {
  const plain = text.trim().replace(",", ".");
  return NUMBER.test(plain) ? Number(plain) : null;
}

const noNumber = (text: string): Typed => ({ wrong: said("{text} is no number", { text }) });

/** One number. */
export function oneNumber(text: string): Typed {
  const value = number(text);
  return text.trim() === "" ? { value: undefined } : value === null ? noNumber(text) : { value };
}

/**
 * Several values side by side, all of them or none.
 *
 * @param texts What stands in each cell.
 * @param numbers Whether each of them is a number.
 * @param names What each of them is called.
 */
export function sideBySide(
  texts: readonly string[],
  numbers: readonly boolean[],
  names: readonly string[],
): Typed {
  const cells = texts.map((text) => text.trim());
  if (cells.every((text) => text === "")) return { value: undefined };
  const empty = names.filter((_, k) => cells[k] === "");
  if (empty.length > 0) return { wrong: said("missing: {names}", { names: empty.join(", ") }) };
  const values = cells.map((text, k) => (numbers[k] ? number(text) : text));
  const wrong = values.indexOf(null);
  return wrong < 0 ? { value: values } : noNumber(cells[wrong]!);
}

/**
 * A list of numbers, with `;` or blanks between them, or of words, with `,` or `;` between them; in square brackets
 * as the file has it.
 */
export function list(text: string, numbers: boolean): Typed {
  const plain = text.trim();
  if (plain.startsWith("[")) return inBrackets(plain, numbers);
  // After a number a comma separates where a blank follows; between digits it stands before decimals.
  const parts = plain.split(numbers ? /\s*;\s*|,?\s+/ : /[,;]/).map((part) => part.trim());
  const given = parts.filter((part) => part !== "");
  if (given.length === 0) return { value: undefined };
  if (!numbers) return { value: given };
  const values = given.map(number);
  const wrong = values.indexOf(null);
  if (wrong < 0) return { value: values };
  const part = given[wrong]!;
  return part.includes(",")
    ? { wrong: said("{text} is no number: several are separated by blanks or by ;", { text: part }) }
    : noNumber(part);
}

function inBrackets(text: string, numbers: boolean): Typed {
  try {
    const value: unknown = JSON.parse(text);
    const each = numbers ? "number" : "string";
    if (Array.isArray(value) && value.every((one) => typeof one === each)) return { value };
  } catch {
    // Said below.
  }
  return { wrong: said("not JSON") };
}

/** A list as `list` reads it. */
export function listed(value: readonly unknown[]): string {
  const plain = value.every((one) => typeof one === "number" || !/^\[|[,;]|^\s|\s$/.test(String(one)));
  return plain ? value.join(", ") : JSON.stringify(value);
}
