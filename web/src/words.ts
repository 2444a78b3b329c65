// Words in the language that was chosen. The engine speaks English; what it says is translated where it is shown, by
// the sentence of its source that it was made from, as in `seerob.outputs.words`.

import alone from "../../src/seerob/outputs/words/alone.txt?raw";
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
export function said(text: string, values?: Readonly<Record<string, string | number>>): string {
  const chosen = language.value;
  const found = chosen === "en" ? text : (CATALOGUES[chosen][text] ?? text);
  // Without values nothing is made: buttons in the room are asked for their words ten times a second.
  return values ? filled(found, values) : found;
}

// Apart, as what a function closes over is made whenever that is called.
function filled(text: string, values: Readonly<Record<string, string | number>>): string {
  return text.replace(/\{(\w+)\}/g, (all, name: string) => String(values[name] ?? all));
}

interface Sentence {
  /** Its longest words without a value. */
  words: string;
  pattern: RegExp;
  /** How many letters are its own; of two sentences that fit, the one with more is meant. */
  own: number;
  translation: string;
}

/** Single words that the engine says. Any other, such as the label of a button, may be a name of the file and stays. */
const ALONE: ReadonlySet<string> = new Set(alone.split("\n"));
const MOST_KEPT = 4000;
/** A sentence that begins with a value and has fewer letters of its own has to know its values too. */
const OWN = 9;
const sentences = new Map<string, readonly Sentence[]>();
const kept = new Map<string, string>();

/** What the engine says, in the chosen language; as it is where no catalogue has it. */
export function told(text: string): string {
  const chosen = language.value;
  return chosen === "en" ? text : toldIn(text, chosen);
}

function toldIn(text: string, chosen: Exclude<Language, "en">): string {
  const key = `${chosen} ${text}`;
  let found = kept.get(key);
  if (found === undefined) {
    if (kept.size >= MOST_KEPT) kept.clear();
    found = translated(text, chosen);
    kept.set(key, found);
  }
  return found;
}

function translated(text: string, chosen: Exclude<Language, "en">): string {
  const whole = CATALOGUES[chosen][text];
  if (whole !== undefined && (text.includes(" ") || ALONE.has(text))) return whole;
  for (const { words, own, pattern, translation } of sentencesOf(chosen)) {
    const match = text.includes(words) && pattern.exec(text);
    if (!match) continue;
    // A value may be a sentence itself; a name or a figure stays.
    const given = match.slice(1);
    const values = given.map((value) => (value.includes(" ") ? toldIn(value, chosen) : value));
    if (own < OWN && pattern.source.startsWith("^(") && !given.every((value, i) => known(value, values[i]!)))
      continue;
    return translation.replace(/\{(\d+)\}/g, (_, place: string) => values[Number(place)]!);
  }
  if (text.includes("; "))
    return text
      .split("; ")
      .map((each) => toldIn(each, chosen))
      .join("; ");
  if (text.includes(", ")) {
    const parts = text.split(", ");
    const found = parts.map((each) => toldIn(each, chosen));
    // A list of words or names; of a sentence that no catalogue has no half is translated.
    if (parts.every((each, i) => known(each, found[i]!))) return found.join(", ");
  }
  const colon = text.indexOf(": ");
  if (colon >= 0 && !text.slice(0, colon).includes("("))
    return `${toldIn(text.slice(0, colon), chosen)}: ${toldIn(text.slice(colon + 2), chosen)}`;
  const inside = /^(.+) \(([^()]+)\)$/.exec(text);
  if (inside) return `${toldIn(inside[1]!, chosen)} (${toldIn(inside[2]!, chosen)})`;
  const figure = /^(\D*[^\d\s−-]) ([−-]?\d\S*)$/.exec(text);
  return figure ? `${toldIn(figure[1]!, chosen)} ${figure[2]}` : text;
}

/** Whether a part is translated, or is a name or the place in a standard, which stays. */
function known(text: string, translation: string): boolean {
  return text !== translation || !text.includes(" ") || /^(?:ISO|IEC|EN|DIN)\b/.test(text);
}

function sentencesOf(chosen: Exclude<Language, "en">): readonly Sentence[] {
  const made = sentences.get(chosen);
  if (made) return made;
  const found: Sentence[] = [];
  for (const [text, translation] of Object.entries(CATALOGUES[chosen])) {
    const words = text.split(/\{\d+\}/);
    if (words.length < 2) continue;
    const escaped = words.map((each) => each.replace(/[.*+?^${}()|[\]\\]/g, "\\$&"));
    const longest = words.reduce((a, b) => (b.length > a.length ? b : a));
    const pattern = new RegExp(`^${escaped.join("([^;]+?)")}$`);
    found.push({ words: longest, own: words.join("").length, pattern, translation });
  }
  found.sort((a, b) => b.own - a.own);
  sentences.set(chosen, found);
  return found;
}

/** Marks a text that `said` is given later, so that catalogues are known to need it. */
export const word = <T extends string>(text: T): T => text;
