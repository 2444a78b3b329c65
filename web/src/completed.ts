// A snapshot with all its fields: on the wire, what is as its default says is left out.

import { DEFAULTS, type Marker, type Result, type Snapshot } from "./wire";

export function completed(message: Snapshot): Snapshot {
  const snapshot = { ...DEFAULTS.snapshot, ...message };
  return { ...snapshot, results: snapshot.results.map(result) };
}

function result(message: Result): Result {
  const whole = { ...DEFAULTS.result, ...message };
  return { ...whole, parts: whole.parts.map(result), markers: whole.markers.map(marker) };
}

function marker<M extends Marker>(message: M): M {
  return { ...DEFAULTS[message.type], ...message };
}
