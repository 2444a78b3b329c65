// Forms from the JSON schema of the workstation file, which `seerob schema` writes and the server has.

import { signal } from "@preact/signals";
import type { Table } from "./draft";

/** What of JSON schema the workstation's uses. */
export interface Schema {
  $ref?: string;
  anyOf?: Schema[];
  oneOf?: Schema[];
  allOf?: Schema[];
  type?: string;
  const?: unknown;
  enum?: unknown[];
  title?: string;
  description?: string;
  properties?: Record<string, Schema>;
  required?: string[];
  items?: Schema | false;
  prefixItems?: Schema[];
  default?: unknown;
  minItems?: number;
  $defs?: Record<string, Schema>;
  "x-unit"?: string;
  /** What each of several numbers is. */
  "x-parts"?: string[];
  /** Whether a list is of the corners of a polygon. */
  "x-polygon"?: boolean;
  /** Groups of alternatives of which a table has one: the keys of each. */
  "x-one-of"?: string[][][];
}

export interface Field {
  name: string;
  /** Its key in SI. */
  base: string;
  schema: Schema;
  required: boolean;
  unit: string;
  /** What it is; of a key with a suffix its unit is in the name. */
  about: string;
}

export const schema = signal<Schema | null>(null);
let asked = false;

/** Fetch the schema, once. */
export async function fetchSchema(): Promise<void> {
  if (asked) return;
  asked = true;
  const response = await fetch(`/schema.json${location.search}`);
  if (response.ok) schema.value = (await response.json()) as Schema;
  else asked = false;
}

function resolved(one: Schema): Schema {
  const name = one.$ref?.split("/").pop();
  return name ? { ...schema.value?.$defs?.[name], ...one } : one;
}

/** Without the null of what may be left out. */
export function given(one: Schema): Schema {
  const options = one.anyOf?.filter((option) => option.type !== "null");
  return options?.length === 1 ? { ...resolved(options[0]!), ...pick(one) } : resolved(one);
}

function pick({ description, default: otherwise, "x-unit": unit }: Schema): Schema {
  return {
    ...(description === undefined ? {} : { description }),
    ...(unit === undefined ? {} : { "x-unit": unit }),
    default: otherwise,
  };
}

/** Kinds of a list whose entries have one, with what each is. */
export function kinds(group: string): [kind: string, about: string][] {
  return options(group)
    .map((option): [string, string] => [
      String(option.properties?.kind?.const ?? ""),
      option.description ?? "",
    ])
    .filter(([kind]) => kind !== "");
}

function options(group: string): Schema[] {
  if (group === "waypoints") {
    const source = options("sources").find((option) => option.properties?.kind?.const === "waypoints");
    const points = source?.properties?.points && given(source.properties.points);
    return points?.items ? [resolved(points.items)] : [];
  }
  const items = schema.value?.properties?.[group]?.items;
  return items ? (items.anyOf ?? [items]) : [];
}

/** Schema of an entry; null where there is none, such as for a kind of one's own. */
export function entrySchema(group: string, table: Table): Schema | null {
  const found = options(group);
  const one =
    "kind" in table || found.some((option) => option.properties?.kind)
      ? found.find((option) => option.properties?.kind?.const === table.kind)
      : found[0];
  return one ? resolved(one) : null;
}

/** Its fields, required ones first; of a quantity in several units the key that is used, or that in SI. */
export function fields(one: Schema, table: Table): Field[] {
  const required = new Set(one.required ?? []);
  for (const { oneOf } of one.allOf ?? []) {
    const first = oneOf?.[0]?.required?.[0];
    if (first) required.add(first);
  }
  const shown = new Map<string, Field>();
  for (const [name, property] of Object.entries(one.properties ?? {})) {
    if (name === "kind") continue;
    const base = baseOf(name, property);
    if (shown.has(base) && !(name in table)) continue;
    const value = given(property);
    const unit = base === name ? (value["x-unit"] ?? "") : name.slice(base.length + 1).replaceAll("_", "/");
    const about = base === name ? (value.description ?? "") : "";
    const parts = given(one.properties?.[base] ?? {})["x-parts"];
    const whole = parts ? { ...value, "x-parts": parts } : value;
    shown.set(base, { name, base, schema: whole, required: required.has(base), unit, about });
  }
  return [...shown.values()].sort((a, b) => Number(b.required) - Number(a.required));
}

/** Of alternatives of which a table has one: which, and the keys that the table has of each. */
export function alternatives(one: Schema, table: Table): { chosen: number; keys: string[][] }[] {
  const keysOf = (base: string): string[] =>
    Object.entries(one.properties ?? {})
      .filter(([name, property]) => name in table && baseOf(name, property) === base)
      .map(([name]) => name);
  return (one["x-one-of"] ?? []).map((group) => {
    const keys = group.map((bases) => bases.flatMap(keysOf));
    return { chosen: keys.findIndex(({ length }) => length > 0), keys };
  });
}

// `limit_mm` is described as `limit in mm`, and comes behind `limit`.
function baseOf(name: string, { description }: Schema): string {
  const base = description?.match(/^(\w+) in \S+$/)?.[1];
  return base && name.startsWith(`${base}_`) ? base : name;
}
