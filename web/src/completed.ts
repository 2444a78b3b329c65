// A snapshot with all its fields and their names: on the wire a field of the snapshot is left out when it is as
// its default says, and results, rows, aspects and markers are arrays.

import {
  type Aspect,
  DEFAULTS,
  FIELDS,
  type Marker,
  type Measured,
  type Result,
  type Row,
  type Snapshot,
} from "./wire";

type Sent = readonly unknown[];

/** The result of a measurement that a decoder gives, as the types say it is. */
export function completedMeasure(message: Measured): Measured {
  return { ...message, result: message.result && result(message.result as unknown as Sent) };
}

/** What a decoder gives, as the types say it is. */
export function completed(message: Snapshot): Snapshot {
  const snapshot = { ...DEFAULTS.snapshot, ...message };
  return { ...snapshot, results: each(snapshot.results, result) };
}

function result(sent: Sent): Result {
  const found = named<Result>(FIELDS.result, sent);
  found.parts = each(found.parts, result);
  found.markers = each(found.markers, marker);
  found.rows = each(found.rows, row);
  return found;
}

function row(sent: Sent): Row {
  const found = named<Row>(FIELDS.row, sent);
  found.aspects = each(found.aspects, (aspect) => named<Aspect>(FIELDS.aspect, aspect));
  return found;
}

const marker = (sent: Sent): Marker => named<Marker>(FIELDS[sent[0] as Marker["type"]], sent);

/** What is in a list of arrays. */
const each = <T>(list: unknown, read: (sent: Sent) => T): T[] => (list as Sent[]).map(read);

function named<T>(names: readonly string[], sent: Sent): T {
  const found: Record<string, unknown> = {};
  for (let k = 0; k < names.length; k += 1) found[names[k]!] = sent[k];
  return found as T;
}
