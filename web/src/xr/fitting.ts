// Fits the person to whoever wears the headset, in ten seconds: where the floor is, how tall they are, and how the
// controllers lie in their hands. A panel leads through it; the run's source calibrates.

import { effect } from "@preact/signals";
import { Matrix4 } from "three";
import { ask, draft, mayEdit } from "../editing/draft";
import { tracked } from "../page_state";
import { said, told, word } from "../words";
import { INK, Panel } from "./panel";

const PIXELS = { width: 1080, height: 420 };
/** How long the controller lies on the floor, to take the pose, and to stand in it [ms]. */
const LIES_MS = 500;
const READY_MS = 4000;
const STANDS_MS = 2000;
/** An answer that is that of before is not told again [ms]. */
const WAITS_MS = 3000;
/** How high the grip of a controller is that lies on a floor [m]; our choice. */
const LIES = 0.03;
/** A floor that is farther off from where the device has it [m] is none. */
const MOST_OFF = 0.3;

type Step = "floor" | "ready" | "stand" | "waits" | "done";

const WORDS: Record<Step, readonly string[]> = {
  floor: [
    word("Where is your floor?"),
    word("Lay a controller on it, and pull the trigger of the other one."),
  ],
  ready: [word("Stand upright, look ahead"), word("Arms to the sides, palms down.")],
  stand: [word("Stand still"), ""],
  waits: [word("Looking at it…"), ""],
  done: ["", ""],
};

export class Fitting extends Panel {
  step: Step = "done";
  /** The room that poses are told in from `local-floor`: its floor is where the controller lay. */
  readonly roomFromFloor = new Matrix4();
  private heights: number[] = [];
  private lying: XRHandedness | null = null;
  private since = 0;
  private now = 0;
  private told = "";
  private readonly forget: () => void;

  /** @param human The person that the visitor is. */
  constructor(
    private readonly human: string,
    private readonly placed: () => void,
  ) {
    super(PIXELS);
    this.mesh.visible = false;
    this.forget = effect(() => {
      const answer = tracked.value;
      if (answer?.fits == null) return;
      if (this.step === "waits") this.step = "done";
    });
  }

  /** Whether the triggers belong to it. */
  get active(): boolean {
    return this.step !== "done";
  }

  /** The pose that the wearer says to stand in now. */
  get stands(): "tpose" | "" {
    return this.step === "stand" ? "tpose" : "";
  }

  begin(): void {
    this.step = "floor";
    this.heights = [];
    this.mesh.visible = true;
  }

  /** Words on the panel. */
  get lines(): string[] {
    const answer = tracked.peek();
    if (this.step === "ready") {
      const left = Math.ceil((READY_MS - (this.now - this.since)) / 1000);
      return [...WORDS.ready.map((each) => said(each)), `${Math.max(left, 1)}`];
    }
    if (this.step !== "done") return WORDS[this.step].map((each) => said(each));
    if (answer?.fits == null) return [];
    const title = said(answer.fits ? word("It fits") : word("It does not fit: again"));
    const taller =
      answer.taller == null
        ? ""
        : said("You are {share} % as tall as {name} of the file.", {
            share: (100 * answer.taller).toFixed(0),
            name: this.human,
          });
    const save = this.stature() === null ? "" : said("“my stature” at the wrist puts yours into the file.");
    return [title, ...cut(told(answer.found)), taller, save].filter(Boolean);
  }

  /** The visitor's stature [m], where that can be put into the file and is not there; else null. */
  stature(): number | null {
    const { taller, fits } = tracked.peek() ?? {};
    if (!fits || taller == null || Math.abs(taller - 1) < 5e-3 || !mayEdit.peek()) return null;
    const own = this.row()?.stature;
    return typeof own === "number" ? Math.round(1000 * own * taller) / 1000 : null;
  }

  /** Put the visitor's stature into the file. */
  keepStature(): void {
    const stature = this.stature();
    const people = draft.peek()?.tables.humans as { name: string }[] | undefined;
    const k = people?.findIndex(({ name }) => name === this.human) ?? -1;
    if (stature === null || k < 0) return;
    void ask("change", [{ kind: "set", path: ["humans", k, "stature"], value: stature }]);
  }

  /** A trigger was pulled: the other controller lies on the floor. */
  press({ handedness }: XRInputSource, sources: Iterable<XRInputSource>): void {
    if (this.step !== "floor") return;
    const others = [...sources].filter((one) => one.gripSpace && !one.hand && one.handedness !== handedness);
    this.lying = others[0]?.handedness ?? handedness;
    this.since = this.now;
    this.heights = [];
  }

  /** Once per picture, before the person is looked at. */
  tick(time: number, frame: XRFrame, floor: XRReferenceSpace, sources: Iterable<XRInputSource>): void {
    this.now = time;
    // Hands that hold nothing cannot tell where the floor is: the device's holds.
    if (this.step === "floor" && ![...sources].some((one) => one.gripSpace && !one.hand)) this.go("ready");
    if (this.step === "floor" && this.lying) {
      for (const { handedness, gripSpace } of sources) {
        const pose = handedness === this.lying && gripSpace ? frame.getPose(gripSpace, floor) : null;
        if (pose) this.heights.push(pose.transform.position.y);
      }
      if (time - this.since >= LIES_MS && this.heights.length > 0) this.lie();
    } else if (this.step === "ready" && time - this.since >= READY_MS) this.go("stand");
    else if (this.step === "stand" && time - this.since >= STANDS_MS) this.go("waits");
    else if (this.step === "waits" && time - this.since >= WAITS_MS) this.go("done");
  }

  override dispose(): void {
    this.forget();
    super.dispose();
  }

  protected news(): boolean {
    const words = this.lines.join("\n");
    const same = words === this.told;
    this.told = words;
    return !same;
  }

  protected paint(): void {
    this.lines.forEach((line, k) => {
      const [ink, font] = k === 0 ? [INK, "bold 54px sans-serif"] : [INK, "36px sans-serif"];
      this.write(line, 28, 78 + 66 * k, ink, font, PIXELS.width - 56);
    });
  }

  private go(step: Step): void {
    this.step = step;
    this.since = this.now;
  }

  private lie(): void {
    const sorted = this.heights.sort((a, b) => a - b);
    const off = sorted[sorted.length >> 1]! - LIES;
    this.lying = null;
    if (Math.abs(off) > MOST_OFF) return;
    this.roomFromFloor.makeTranslation(0, -off, 0);
    this.placed();
    this.go("ready");
  }

  private row(): { stature?: unknown } | undefined {
    const people = draft.peek()?.tables.humans as { name: string; stature?: unknown }[] | undefined;
    return people?.find(({ name }) => name === this.human);
  }
}

/** A sentence on lines that fit on the panel. */
function cut(text: string): string[] {
  const lines: string[] = [""];
  for (const word of text.split(" ")) {
    const last = lines[lines.length - 1]!;
    if (last.length + word.length > 56) lines.push(word);
    else lines[lines.length - 1] = last ? `${last} ${word}` : word;
  }
  return lines.slice(0, 3);
}
