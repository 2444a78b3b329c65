// One maker per kind of marker. A kind that is missing here does not compile.

import type { Marker } from "../wire";
import { ArrowDrawn } from "./arrow";
import { BoxDrawn } from "./box";
import type { Drawn } from "./drawn";
import { EllipsoidDrawn } from "./ellipsoid";
import { HighlightDrawn } from "./highlight";
import { HullDrawn } from "./hull";
import { LabelDrawn } from "./label";
import { PolylineDrawn } from "./polyline";
import { PrismDrawn } from "./prism";
import { RaysDrawn } from "./rays";
import { SegmentDrawn } from "./segment";
import { SphereDrawn } from "./sphere";

type Makers = { readonly [K in Marker["type"]]: () => Drawn<Extract<Marker, { type: K }>> };

const MAKERS: Makers = {
  arrow: () => new ArrowDrawn(),
  segment: () => new SegmentDrawn(),
  sphere: () => new SphereDrawn(),
  ellipsoid: () => new EllipsoidDrawn(),
  box: () => new BoxDrawn(),
  hull: () => new HullDrawn(),
  polyline: () => new PolylineDrawn(),
  prism: () => new PrismDrawn(),
  rays: () => new RaysDrawn(),
  label: () => new LabelDrawn(),
  highlight: () => new HighlightDrawn(),
};

/** Something that draws markers of this one's kind; null for a kind that this page does not know. */
export function makeDrawn(marker: Marker): Drawn<Marker> | null {
  if (!Object.hasOwn(MAKERS, marker.type)) return null;
  return MAKERS[marker.type]() as Drawn<Marker>;
}
