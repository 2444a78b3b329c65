// A board in the room: the run's verdict and its criteria, drawn from what feeds the panels of the page.

import { computed, effect } from "@preact/signals";
import { asking, draft, mayEdit, refused } from "../editing/draft";
import { against, withUnit } from "../figures";
import { shortened } from "../format";
import { runState, stale } from "../page_state";
import { orderedRows } from "../row_order";
import { STATE_ICONS, STATE_WORDS, type State } from "../verdicts";
import { language, said, told, word } from "../words";
import { INK, Panel } from "./panel";

/** Letters of a criterion are 11 mm high, to be read at arm's length. */
const PIXELS = { width: 1080, height: 720 };
const ROW_PX = 54;
const MARGIN_PX = 28;
/** Where names begin, and what there is below the rows. */
const NAME_PX = MARGIN_PX + 52;
const FOOT_PX = 56;
/** Why a criterion is undecided stands below it: how high that is, and how many characters at most. */
const REASON_PX = 38;
const REASON = 90;
const COLORS: Record<State, string> = {
  exceeded: "#ff8fa6",
  undecided: "#fbe36a",
  missing: "#fbe36a",
  close: "#7ee7f1",
  within: "#7ee7f1",
  none: INK,
};

/** What became of the workstation file that is edited; empty where this page may not. */
export const edits = computed(() => {
  if (!mayEdit.value) return "";
  const wrong = refused.value?.mistakes[0];
  if (wrong) return [wrong.key, told(wrong.what), told(wrong.remedy)].filter(Boolean).join(": ");
  if (asking.value) return said("checking …");
  return said(draft.value?.diff ? word("not saved") : word("saved"));
});

export class Board extends Panel {
  private readonly forget: () => void;
  private changed = true;

  constructor() {
    super(PIXELS);
    this.forget = effect(() => {
      void [orderedRows.value, runState.value, stale.value, edits.value, language.value];
      this.changed = true;
    });
  }

  /** Lines as they stand on it, worst first. */
  static lines(): { state: State; text: string; figure: string; reason: string }[] {
    return orderedRows.peek().map(({ info, result, state }) => {
      const shown =
        result && result.value !== null
          ? against(result.value, result.limit, result.unit, result.at_most)
          : null;
      const limit = shown && result?.limit !== null ? ` / ${shown.limit}` : "";
      return {
        state,
        text: info.name,
        figure: shown ? withUnit(`${shown.value}${limit}`, info.unit) : "",
        reason: result && state === "undecided" ? shortened(told(result.reason), REASON) : "",
      };
    });
  }

  protected news(): boolean {
    const { changed } = this;
    this.changed = false;
    return changed;
  }

  protected paint(): void {
    const { brush } = this;
    const { width, height } = PIXELS;
    const whole: State = stale.peek() ? "missing" : runState.peek();
    const headline = stale.peek()
      ? said("NO CURRENT DATA")
      : `${STATE_ICONS[whole]} ${said("run: {state}", { state: said(STATE_WORDS[whole]) })}`;
    this.write(headline, MARGIN_PX, 62, COLORS[whole], "bold 46px sans-serif");
    const lines = stale.peek() ? [] : Board.lines();
    let y = 130;
    let drawn = 0;
    for (const { state, text, figure, reason } of lines) {
      const below = reason === "" ? 0 : REASON_PX;
      if (y + below > height - FOOT_PX) break;
      this.write(STATE_ICONS[state], MARGIN_PX, y, COLORS[state], "bold 38px sans-serif");
      brush.font = "36px sans-serif";
      const left = width - MARGIN_PX - 32 - NAME_PX - brush.measureText(figure).width;
      this.write(text, NAME_PX, y, INK, "36px sans-serif", left);
      brush.textAlign = "right";
      this.write(figure, width - MARGIN_PX, y, COLORS[state], "36px sans-serif");
      brush.textAlign = "left";
      const room = width - MARGIN_PX - NAME_PX;
      this.write(reason, NAME_PX, y + REASON_PX, COLORS[state], "26px sans-serif", room);
      y += ROW_PX + below;
      drawn += 1;
    }
    const more = lines.length > drawn ? said("and {n} more", { n: lines.length - drawn }) : "";
    const below = [more, edits.peek()].filter(Boolean).join(" · ");
    this.write(below, MARGIN_PX, height - 14, "#aab6c6", "28px sans-serif", width - 2 * MARGIN_PX);
  }

  override dispose(): void {
    this.forget();
    super.dispose();
  }
}
