// A choice that this browser keeps for the next time; a browser that keeps nothing is no reason to fail.

import { effect, type Signal, signal } from "@preact/signals";

/** A signal that begins with what was chosen last, if that is still one of the choices. */
export function remembered<T extends string>(key: string, choices: readonly T[], otherwise: T): Signal<T> {
  const kept = read(key);
  const chosen = signal(choices.find((choice) => choice === kept) ?? otherwise);
  effect(() => keep(key, chosen.value));
  return chosen;
}

function read(key: string): string | null {
  try {
    return localStorage.getItem(key);
  } catch {
    return null;
  }
}

function keep(key: string, value: string): void {
  try {
    localStorage.setItem(key, value);
  } catch {
    // Private windows may refuse: then it holds until the page is closed.
  }
}
