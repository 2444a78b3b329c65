// What of a result is drawn in the room, by kind, for the legend.

import type { Marker } from "../wire";

/** How a kind of marker is called and pictured (24 × 16) in the legend. */
export const SIGNS: Record<Marker["type"], { word: string; path: string; filled?: boolean }> = {
  arrow: { word: "arrow", path: "M3 13L17 4M17 4l-5 .6M17 4l-1.8 4.6" },
  segment: { word: "line", path: "M4 12L20 4M4 12h.01M20 4h.01" },
  sphere: { word: "ball", path: "M18 8A6 6 0 1 1 6 8a6 6 0 0 1 12 0zM6 8c3 2.5 9 2.5 12 0" },
  ellipsoid: {
    word: "ellipsoid",
    path: "M21 8c0 2.5-4 4.5-9 4.5S3 10.5 3 8s4-4.5 9-4.5S21 5.5 21 8zM12 3.5v9",
  },
  box: { word: "box", path: "M4 6l8-3 8 3v6l-8 3-8-3zM4 6l8 3 8-3M12 9v6" },
  hull: { word: "volume", path: "M4 10l5-7 8 1 4 6-7 4zM9 3l5 11M17 4l-3 10M4 10l13-6" },
  polyline: { word: "path", path: "M3 12l5-7 5 5 7-7" },
  prism: { word: "field", path: "M3 12l5-4h13l-5 4zM3 12V7l5-4h13v5" },
  rays: { word: "beams", path: "M3 13L20 3M3 13l18-5M3 13h18" },
  label: { word: "label", path: "M3 4h18v8H3zM6 8h12" },
  highlight: { word: "painted body", path: "M8 3h8v10H8z", filled: true },
};

/** The kinds of some markers, each once, in the order of the table. */
export function kindsOf(markers: readonly Pick<Marker, "type">[]): Marker["type"][] {
  const there = new Set(markers.map((marker) => marker.type));
  return (Object.keys(SIGNS) as Marker["type"][]).filter((kind) => there.has(kind));
}
