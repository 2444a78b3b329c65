// The body map on a board in the room, from what feeds that of the page.

import { effect } from "@preact/signals";
import { LOOK_WORDS, type Look, lookAt, shareOf, toldOf, toldOfRegion } from "../body_map/exposure";
import { HEIGHT, outlines, sideAtRight, type View, WIDTH } from "../body_map/figure";
import { aspect, contacts, only } from "../body_map/shown";
import { percent } from "../figures";
import { frame, stale } from "../page_state";
import { language, said, told, word } from "../words";
import { INK, Panel } from "./panel";

const PIXELS = { width: 1080, height: 1180 };
const TOP_PX = 130;
const SCALE = 2.4;
const VIEWS: readonly View[] = ["front", "back"];
/** As on the page (look/body_map.css), dark theme. */
const COLORS: Record<Look, string> = {
  clear: "#2a3442",
  low: "#14505a",
  middle: "#14aab8",
  high: "#a8f3fa",
  exceeded: "#c11540",
  forbidden: "#c11540",
  undecided: "#8a7a2c",
  none: "#77818f",
};
/** Beside colour. */
const SIGNS: Partial<Record<Look, string>> = { exceeded: "✕", undecided: "?", forbidden: "⊘" };

export class BodyBoard extends Panel {
  private changed = true;
  private readonly forget: () => void;
  private readonly paths = VIEWS.map((view) =>
    outlines(view).map((outline) => ({ outline, path: new Path2D(outline.path) })),
  );

  constructor() {
    super(PIXELS);
    this.forget = effect(() => {
      // What they come to is computed when it is drawn.
      void [frame.value, aspect.value, only.value, stale.value, language.value];
      this.changed = true;
    });
  }

  /** What stands above the figures. */
  static headline(): string {
    const { judged, governing, open } = contacts.peek();
    if (stale.peek()) return said("NO CURRENT DATA");
    if (!judged) return said("no criterion judges contacts");
    if (open !== null && !governing) return `${said("UNDECIDED")}: ${told(open)}`;
    if (!governing) return said("nothing that moves is within reach");
    const { row } = governing;
    const share = shareOf(row, aspect.peek());
    const amount =
      share === null ? "" : `, ${said("{share} of the permissible speed", { share: percent(share, "up") })}`;
    const side = row.side ? `${said(row.side)} ` : "";
    return `${side}${told(row.name)}: ${said(LOOK_WORDS[lookAt(governing, aspect.peek(), open !== null)])}${amount}`;
  }

  protected news(): boolean {
    const { changed } = this;
    this.changed = false;
    return changed;
  }

  protected paint(): void {
    this.write(BodyBoard.headline(), 28, 62, INK, "bold 36px sans-serif", PIXELS.width - 56);
    if (stale.peek()) return;
    for (const [k, view] of VIEWS.entries()) this.figure(view, k);
  }

  override dispose(): void {
    this.forget();
    super.dispose();
  }

  private figure(view: View, k: number): void {
    const { brush } = this;
    const { all, open, spots } = contacts.peek();
    const limit = aspect.peek();
    brush.save();
    brush.translate(40 + (k * PIXELS.width) / 2, TOP_PX);
    brush.scale(SCALE, SCALE);
    for (const { outline, path } of this.paths[k]!) {
      brush.fillStyle =
        COLORS[lookAt(toldOfRegion(outline.region, outline.side, all, limit), limit, open !== null)];
      brush.globalAlpha = 0.55;
      brush.fill(path);
      brush.globalAlpha = 1;
      brush.strokeStyle = "#46566b";
      brush.stroke(path);
    }
    brush.textAlign = "center";
    brush.textBaseline = "middle";
    for (const spot of spots) {
      if (spot.view !== view) continue;
      const look = lookAt(toldOf(spot, all, limit), limit, open !== null);
      brush.beginPath();
      brush.arc(spot.x, spot.y, spot.r, 0, 2 * Math.PI);
      brush.fillStyle = COLORS[look];
      brush.fill();
      brush.stroke();
      const sign = SIGNS[look];
      if (sign) this.write(sign, spot.x, spot.y, "#ffffff", "bold 8px sans-serif");
    }
    const right = sideAtRight(view);
    this.write(
      said(right === "left" ? word("right") : word("left")),
      24,
      HEIGHT - 8,
      "#aab6c6",
      "11px sans-serif",
    );
    this.write(said(right), WIDTH - 24, HEIGHT - 8, "#aab6c6", "11px sans-serif");
    brush.restore();
  }
}
