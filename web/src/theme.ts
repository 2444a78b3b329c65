// Dark or light, as the system prefers or as was chosen here.

import { computed, effect, signal } from "@preact/signals";
import { remembered } from "./remembered";
import { word } from "./words";

export const THEMES = [word("system"), word("dark"), word("light")] as const;

export const chosenTheme = remembered("seerob.theme", THEMES, "system");

const preference = matchMedia("(prefers-color-scheme: light)");
const prefersLight = signal(preference.matches);
preference.addEventListener("change", () => {
  prefersLight.value = preference.matches;
});

export const theme = computed<"dark" | "light">(() =>
  chosenTheme.value === "system" ? (prefersLight.value ? "light" : "dark") : chosenTheme.value,
);

effect(() => {
  document.documentElement.dataset.theme = theme.value;
});

/** A colour of the style sheet, for canvases outside of the room: `--curve`. */
export function colorOf(name: `--${string}`): string {
  return getComputedStyle(document.documentElement).getPropertyValue(name);
}
