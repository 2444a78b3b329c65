// One view of the body map: regions in the colour of their worst area, and the areas as spots on them.

import type { Look } from "../body_map/exposure";
import { HEIGHT, type Outline, outlines, type Spot, sideAtRight, type View, WIDTH } from "../body_map/figure";
import { said, word } from "../words";

export interface DrawnSpot extends Spot {
  key: string;
  look: Look;
  /** What a reader of the screen says. */
  title: string;
}

/** Beside colour: what a look is written as. */
const SIGNS: Partial<Record<Look, string>> = { exceeded: "✕", undecided: "?", forbidden: "⊘" };

const SEEN: Record<View, string> = { front: word("from in front"), back: word("from behind") };
const VIEWS: Record<View, readonly Outline[]> = { front: outlines("front"), back: outlines("back") };

export function BodyFigure(props: {
  view: View;
  spots: readonly DrawnSpot[];
  regionLook: (outline: Outline) => Look;
  chosen: string | null;
  /** The one that the tab key reaches; arrows go on from it. */
  reachable: string | null;
  onPoint: (key: string | null) => void;
  onChoose: (key: string) => void;
}) {
  const { view, spots, regionLook, chosen, reachable, onPoint, onChoose } = props;
  const right = sideAtRight(view);
  return (
    <figure class="body-figure">
      {/* biome-ignore lint/a11y/useSemanticElements: a fieldset is no picture. */}
      <svg
        viewBox={`0 0 ${WIDTH} ${HEIGHT}`}
        role="group"
        aria-label={`${said("Whole body")}, ${said(SEEN[view])}`}
      >
        <defs>
          <pattern
            id={`forbidden-${view}`}
            width="6"
            height="6"
            patternUnits="userSpaceOnUse"
            patternTransform="rotate(45)"
          >
            <rect width="6" height="6" class="hatch-ground" />
            <path d="M0 0V6" class="hatch-line" />
          </pattern>
          <pattern
            id={`undecided-${view}`}
            width="7"
            height="7"
            patternUnits="userSpaceOnUse"
            patternTransform="rotate(-45)"
          >
            <rect width="7" height="7" class="doubt-ground" />
            <path d="M0 0V7" class="doubt-line" />
          </pattern>
        </defs>
        {VIEWS[view].map((outline) => {
          const look = regionLook(outline);
          return (
            <path
              key={`${outline.region} ${outline.side}`}
              class={`region look-${look}`}
              d={outline.path}
              style={{ fill: fillOf(look, view) }}
              data-region={outline.region}
              data-side={outline.side}
            />
          );
        })}
        {spots.map((spot) => (
          // biome-ignore lint/a11y/useSemanticElements: a button cannot be drawn inside an SVG.
          <g
            key={spot.key}
            class={`spot look-${spot.look} ${spot.key === chosen ? "chosen" : ""}`}
            role="button"
            tabIndex={spot.key === reachable ? 0 : -1}
            aria-label={spot.title}
            aria-pressed={spot.key === chosen}
            data-spot={spot.key}
            onPointerEnter={() => onPoint(spot.key)}
            onPointerLeave={() => onPoint(null)}
            onFocus={() => onPoint(spot.key)}
            onBlur={() => onPoint(null)}
            onClick={() => onChoose(spot.key)}
          >
            <circle class="target" cx={spot.x} cy={spot.y} r={Math.max(spot.r + 2, 7)} />
            <circle cx={spot.x} cy={spot.y} r={spot.r} style={{ fill: fillOf(spot.look, view) }} />
            {SIGNS[spot.look] && (
              <text x={spot.x} y={spot.y}>
                {SIGNS[spot.look]}
              </text>
            )}
          </g>
        ))}
        <text class="side" x="20" y="414">
          {said(right === "left" ? "right" : "left")}
        </text>
        <text class="side" x={WIDTH - 20} y="414">
          {said(right)}
        </text>
      </svg>
      <figcaption>{said(SEEN[view])}</figcaption>
    </figure>
  );
}

// A rule of a style sheet would look for the patterns in its own file.
function fillOf(look: Look, view: View): string | undefined {
  if (look === "forbidden") return `url(#forbidden-${view})`;
  if (look === "undecided") return `url(#undecided-${view})`;
  return undefined;
}
