// Edges of a surface that say something of its shape. Of a surface that bends gently nearly everywhere, such
// as a swept volume, they would be a net that hides what is inside: it is drawn without.

import { BufferGeometry, EdgesGeometry } from "three";

/** Edges that bend less than this only cut a plane into triangles [deg]. */
const FLAT_DEG = 1;
/** Edges that bend more than this are those of facets [deg]. */
const SHARP_DEG = 20;
/** Where less than this share of the bends is sharp, the surface is a round one. */
const LEAST_SHARP = 0.6;
/** More edges than this cannot be told apart. */
const TOO_MANY = 400;

export interface FeatureEdges {
  /** Pairs of points. */
  lines: BufferGeometry;
  /** Whether they leave the shape open, so that its rim has to show it. */
  smooth: boolean;
}

/** The edges to draw of a surface of triangles; none where they are no features. */
export function featureEdges(surface: BufferGeometry): FeatureEdges {
  const bent = new EdgesGeometry(surface, FLAT_DEG);
  const sharp = new EdgesGeometry(surface, SHARP_DEG);
  const smooth = count(sharp) < LEAST_SHARP * count(bent) || count(sharp) > TOO_MANY;
  bent.dispose();
  if (!smooth) return { lines: sharp, smooth };
  sharp.dispose();
  return { lines: new BufferGeometry(), smooth };
}

function count(edges: BufferGeometry): number {
  return edges.getAttribute("position").count / 2;
}
