// Words in the language that was chosen. What criteria, findings and refusals say comes from the engine, in English.

import de from "../../src/seerob/outputs/words/de.json";
import es from "../../src/seerob/outputs/words/es.json";
import fr from "../../src/seerob/outputs/words/fr.json";
import it from "../../src/seerob/outputs/words/it.json";
import { remembered } from "./remembered";

export const LANGUAGES = ["en", "de", "fr", "es", "it"] as const;
export type Language = (typeof LANGUAGES)[number];
/** What each language calls itself. */
export const LANGUAGE_NAMES: Record<Language, string> = {
  en: "English",
  de: "Deutsch",
  fr: "Français",
  es: "Español",
  it: "Italiano",
};
const CATALOGUES: Record<Exclude<Language, "en">, Readonly<Record<string, string>>> = { de, fr, es, it };

/** What is chosen; the browser's own language, if there is a catalogue of it, until then. */
export const language = remembered(
  "seerob.language",
  LANGUAGES,
  LANGUAGES.find((one) => globalThis.navigator?.language.toLowerCase().startsWith(one)) ?? "en",
);

/** A text of the page in the chosen language; `{name}` in it is replaced by the value of that name. */
export function said(text: string, values: Readonly<Record<string, string | number>> = {}): string {
  const chosen = language.value;
  const found = chosen === "en" ? text : (CATALOGUES[chosen][text] ?? text);
  return found.replace(/\{(\w+)\}/g, (all, name: string) => String(values[name] ?? all));
}

/** Marks a text that `said` is given later, so that catalogues are known to need it. */
export const word = <T extends string>(text: T): T => text;
