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

/** Turn the triangles of a closed surface, all of which are turned one way, so that they face outward. */
export function turnOutward(surface: BufferGeometry): void {
  const at = surface.getAttribute("position");
  const index = surface.getIndex();
  const corner = (k: number): number => (index ? index.getX(k) : k);
  const corners = index ? index.count : at.count;
  let volume = 0;
  for (let k = 0; k + 2 < corners; k += 3) {
    const [a, b, c] = [corner(k), corner(k + 1), corner(k + 2)];
    volume +=
      at.getX(a) * (at.getY(b) * at.getZ(c) - at.getZ(b) * at.getY(c)) +
      at.getY(a) * (at.getZ(b) * at.getX(c) - at.getX(b) * at.getZ(c)) +
      at.getZ(a) * (at.getX(b) * at.getY(c) - at.getY(b) * at.getX(c));
  }
  if (volume >= 0) return;
  const turned = Array.from({ length: corners }, (_, k) => corner(k - (k % 3) + 2 - (k % 3)));
  surface.setIndex(turned);
  const normal = surface.getAttribute("normal");
  if (normal)
    for (let k = 0; k < normal.count; k += 1)
      normal.setXYZ(k, -normal.getX(k), -normal.getY(k), -normal.getZ(k));
}

function count(edges: BufferGeometry): number {
  return edges.getAttribute("position").count / 2;
}
