// A panel in the room with what a save would change in the workstation file, line by line.

import { effect } from "@preact/signals";
import { draft } from "../editing/draft";
import { language, said } from "../words";
import { INK, Panel } from "./panel";

const PIXELS = { width: 1080, height: 720 };
const ROW_PX = 34;
const INKS: Record<string, string> = { "+": "#7ee7f1", "-": "#ff8fa6", "@": "#aab6c6" };

export class ReviewPanel extends Panel {
  private changed = true;
  private readonly forget: () => void;

  constructor() {
    super(PIXELS);
    this.forget = effect(() => {
      void [draft.value, language.value];
      this.changed = true;
    });
  }

  protected news(): boolean {
    const { changed } = this;
    this.changed = false;
    return changed;
  }

  protected paint(): void {
    const now = draft.peek();
    const lines = now?.diff.split("\n").slice(2).filter(Boolean) ?? [];
    const title =
      lines.length > 0
        ? said("What changes in {file}", { file: now?.file ?? "" })
        : said("Nothing is changed");
    this.write(title, 28, 52, INK, "bold 38px sans-serif");
    const room = Math.floor((PIXELS.height - 110) / ROW_PX);
    // The newest end of a long one; the desk scrolls.
    const shown = lines.slice(-room);
    shown.forEach((line, k) => {
      const ink = INKS[line[0] ?? ""] ?? INK;
      this.write(line, 28, 100 + k * ROW_PX, ink, "26px monospace", PIXELS.width - 56);
    });
    if (shown.length < lines.length)
      this.write(
        said("{n} lines before", { n: lines.length - shown.length }),
        740,
        52,
        "#fbe36a",
        "28px sans-serif",
      );
  }

  override dispose(): void {
    this.forget();
    super.dispose();
  }
}
