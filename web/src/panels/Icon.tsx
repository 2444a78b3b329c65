// The page's few pictograms, drawn here: nothing is fetched from elsewhere.

const PATHS = {
  eye: "M1.5 8s2.4-4.5 6.5-4.5S14.5 8 14.5 8 12.1 12.5 8 12.5 1.5 8 1.5 8zM8 10a2 2 0 1 0 0-4 2 2 0 0 0 0 4z",
  "eye-off":
    "M2 2l12 12M3.6 5.3C2.2 6.5 1.5 8 1.5 8s2.4 4.5 6.5 4.5c1 0 1.9-.3 2.7-.6M6.5 3.7c.5-.1 1-.2 1.5-.2 4.1 0 6.5 4.5 6.5 4.5s-.6 1.2-1.8 2.3",
  play: "M4.5 2.5v11l9-5.5z",
  pause: "M4.5 2.5v11M11.5 2.5v11",
  back: "M10.5 3L5 8l5.5 5M3 3v10",
  ahead: "M5.5 3L11 8l-5.5 5M13 3v10",
  previous: "M7.5 3.5L3 8l4.5 4.5M13 3.5L8.5 8l4.5 4.5",
  next: "M8.5 3.5L13 8l-4.5 4.5M3 3.5L7.5 8 3 12.5",
  loop: "M3 7a4 4 0 0 1 4-3h6M11 1.5L13.5 4 11 6.5M13 9a4 4 0 0 1-4 3H3M5 9.5L2.5 12 5 14.5",
  chevron: "M6 3.5L10.5 8 6 12.5",
  frame: "M2 5.5V2h3.5M10.5 2H14v3.5M14 10.5V14h-3.5M5.5 14H2v-3.5",
  layers: "M8 2l6 3.5L8 9 2 5.5zM2 8.5L8 12l6-3.5M2 11.5L8 15l6-3.5",
  search: "M7 12A5 5 0 1 0 7 2a5 5 0 0 0 0 10zM10.6 10.6L14 14",
} as const;

export type IconName = keyof typeof PATHS;

export function Icon({ name }: { name: IconName }) {
  const filled = name === "play";
  return (
    <svg class={filled ? "icon filled" : "icon"} viewBox="0 0 16 16" aria-hidden="true" focusable="false">
      <path d={PATHS[name]} />
    </svg>
  );
}
