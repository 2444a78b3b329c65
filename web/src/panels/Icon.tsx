// The page's few pictograms, drawn here: nothing is fetched from elsewhere.

const PATHS = {
  eye: "M1.5 8s2.4-4.5 6.500-4.500S14.500 8 14.500 8 12.100 12.500 8 12.500 1.500 8 1.500 8zM8 10a2 2 0 1 0 0-4 2 2 0 0 0 0 4z",
  "eye-off": "M2 2l12 12M3.600 5.300C2.200 6.500 1.500 8 1.500 8s2.400 4.500 6.500 4.500c1 0 1.900-.3 2.700-.6M6.500 3.700c.5-.1 1-.2 1.500-.2 4.100 0 6.500 4.500 6.500 4.500s-.6 1.200-1.800 2.300",
  play: "M4.500 2.500v11l9-5.500z",
  pause: "M4.500 2.500v11M11.500 2.500v11",
  back: "M10.500 3L5 8l5.500 5M3 3v10",
  ahead: "M5.500 3L11 8l-5.500 5M13 3v10",
  previous: "M7.500 3.500L3 8l4.500 4.500M13 3.500L8.500 8l4.500 4.500",
  next: "M8.500 3.500L13 8l-4.500 4.500M3 3.500L7.500 8 3 12.500",
  loop: "M3 7a4 4 0 0 1 4-3h6M11 1.500L13.500 4 11 6.500M13 9a4 4 0 0 1-4 3H3M5 9.500L2.500 12 5 14.500",
  chevron: "M6 3.500L10.500 8 6 12.500",
  frame: "M2 5.500V2h3.500M10.500 2H14v3.500M14 10.500V14h-3.500M5.500 14H2v-3.500",
  layers: "M8 2l6 3.500L8 9 2 5.500zM2 8.500L8 12l6-3.500M2 11.500L8 15l6-3.500",
  search: "M7 12A5 5 0 1 0 7 2a5 5 0 0 0 0 10zM10.600 10.600L14 14",
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
