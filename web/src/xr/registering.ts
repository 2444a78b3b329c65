// Finds out where the visitor's room lies in the cell: a panel leads through touches of landmarks, the server
// solves. The controller is turned about its tip first, as nobody else knows where that is.

import { effect } from "@preact/signals";
import {
  CanvasTexture,
  Matrix4,
  Mesh,
  MeshBasicMaterial,
  PlaneGeometry,
  Quaternion,
  SphereGeometry,
  SRGBColorSpace,
  Vector3,
} from "three";
import { registered, scene } from "../page_state";
import { markMaterial, uncut } from "../scene/materials";
import type { Viewer } from "../scene/viewer";
import type { Register, Registered } from "../wire";
import { said, told, word } from "../words";
import { cornersIn, type Look, look, mayLook } from "./camera_look";

/** Size in the room [m] and on the canvas [px]. */
const SIZE = { width: 0.6, height: 0.3 };
const PIXELS = { width: 1200, height: 600 };
/** How long a touch is held [ms]. */
const HELD_MS = 500;
/** Poses of a sweep at most, and of a touch; what a page may send is bounded. */
const MOST_SWEEP = 480;
const MOST_TOUCH = 60;
/** One push of a stick moves the room by so much [m], [rad]. */
const NUDGE = 1e-3;
const NUDGE_TURN = Math.PI / 1800;
const PUSHED = 0.7;
const RELEASED = 0.3;
/** The button by which one says that it is done: A or X. */
const DONE = 4;
const ONE = new Vector3(1, 1, 1);

/** On a screen, which has no other button, a press of so long says that it is enough [ms]. */
const LONG_MS = 1500;
/** How the room is found out: by touches with a tip that is found first, by where the controller itself is, or by
 * boards that the device's own camera sees. */
const WAYS = ["sweep", "strapped", "known", "seen"] as const;
type Step = (typeof WAYS)[number] | "touch" | "check" | "align" | "done";
/** Steps at a landmark. */
const AT_LANDMARK: readonly Step[] = ["touch", "check", "strapped", "known", "seen"];
/** Steps after which one may say that it is enough. */
const SOLVED: readonly Step[] = ["touch", "strapped", "known", "seen"];

/** The part of an `XRAnchor` that not every browser has. */
interface Kept {
  requestPersistentHandle?: () => Promise<string>;
}
interface Restores {
  restorePersistentAnchor?: (handle: string) => Promise<XRAnchor>;
}

export class Registering {
  readonly panel: Mesh;
  /** Where the next landmark is, in the world. */
  readonly mark = new Mesh(new SphereGeometry(0.012, 16, 10), markMaterial("over"));
  step: Step;
  /** Which tracking space it is; the server forgets what was known of another. */
  space = crypto.randomUUID();
  /** The anchor's space from `local-floor`; the identity without an anchor. */
  readonly roomFromFloor = new Matrix4();
  private anchor: XRAnchor | null = null;
  private anchoring = false;
  private kept = "";
  private index = 0;
  private number = 0;
  private waits = false;
  private said = "";
  private hand: XRHandedness | null = null;
  private pressed: { hand: XRHandedness; since: number; poses: number[][] } | null = null;
  /** Whether the next picture is looked at, and since when a screen is pressed [ms]. */
  private looks = false;
  private pressedAt = 0;
  private now = 0;
  private readonly pushed = new Set<string>();
  private readonly brush: CanvasRenderingContext2D;
  private readonly texture: CanvasTexture;
  private readonly forget: () => void;
  private readonly moved = new Matrix4();
  private readonly at = new Vector3();
  private readonly turn = new Quaternion();

  /** @param send Takes each step; the answer comes as `registered`. */
  constructor(
    private readonly session: XRSession,
    private readonly viewer: Viewer,
    private readonly human: string | null,
    private readonly send: (asked: Register) => void,
  ) {
    registered.value = null;
    const canvas = document.createElement("canvas");
    Object.assign(canvas, PIXELS);
    this.brush = canvas.getContext("2d")!;
    this.texture = new CanvasTexture(canvas);
    this.texture.colorSpace = SRGBColorSpace;
    const material = uncut(new MeshBasicMaterial({ map: this.texture, transparent: true, fog: false }));
    this.panel = new Mesh(new PlaneGeometry(SIZE.width, SIZE.height), material);
    this.panel.position.set(0, 1.55, -1);
    this.mark.renderOrder = 5;
    this.step = this.ways.includes("seen") && mayLook(session) ? "seen" : "sweep";
    session.addEventListener("selectstart", this.press);
    session.addEventListener("selectend", this.release);
    session.addEventListener("squeezestart", this.takeBack);
    this.forget = effect(() => this.hear(registered.value));
    void this.restore();
  }

  /** Whether the trigger belongs to it. */
  get active(): boolean {
    return this.step !== "done";
  }

  /** Words on the panel. */
  get lines(): string[] {
    const known = registered.peek();
    const name = this.landmark?.name ?? "";
    const words: Record<Step, string[]> = {
      sweep: [
        said("Where is the tip of your controller?"),
        said("Put it on a fixed point, hold the trigger,"),
        said("turn the controller about it for 3 s. Stick up or down: other ways."),
      ],
      strapped: [
        said("Strap it to what carries {name}", { name }),
        said("In several poses of the robot, standing: trigger of the other one."),
        said("Squeeze begins anew, stick up or down: other ways, A ends."),
      ],
      known: [
        said("Lay it at {name}, upright, along its x", { name }),
        said("Pull the trigger of the other one."),
        said("Stick aside: another landmark, up or down: other ways, A ends."),
      ],
      seen: mayLook(this.session)
        ? [
            said("Look at the board at {name}", { name }),
            said("Hold still: trigger or tap, from three places or more."),
            said("Squeeze takes the last one back, A or a long press ends, stick: other ways."),
          ]
        : [
            said("No picture of this device’s camera"),
            said("Its browser hands none over (WebXR: camera-access)."),
            said("Stick up or down: other ways."),
          ],
      touch: [
        said("Touch {name} with the tip", { name }),
        said("Hold still and pull the trigger. Squeeze takes the last one back,"),
        said("the stick chooses another landmark, A ends."),
      ],
      check: [
        said("Touch {name} with the tip", { name }),
        said("It checks what was kept from another session."),
        "",
      ],
      align: [said("Does it fit?"), said("Sticks move the twin by 1 mm and 0.1°; A ends."), ""],
      done: ["", "", ""],
    };
    const lines = [...words[this.step]];
    if (known?.error != null)
      lines.push(
        said("off by {off} mm at {tool} (95 %)", { off: (1e3 * known.error).toFixed(1), tool: known.tool }),
      );
    if (known && known.landmarks.length > 0)
      lines.push(
        said(this.step === "seen" ? word("{n} looks") : word("{n} touched"), { n: known.landmarks.length }),
      );
    lines.push(told(this.said || known?.doubt || ""));
    return lines;
  }

  /** Once per picture, before the person is looked at. */
  tick(time: number, frame: XRFrame, floor: XRReferenceSpace): void {
    this.now = time;
    if (this.looks) this.lookNow(frame, floor);
    void this.settle(frame, floor);
    const anchored = this.anchor && frame.getPose(this.anchor.anchorSpace, floor);
    if (anchored) this.roomFromFloor.fromArray(anchored.transform.inverse.matrix);
    for (const source of this.session.inputSources) this.follow(frame, floor, source);
    this.show();
  }

  /** A new origin of the device: without an anchor nobody knows where the room is. */
  recentred(): void {
    if (this.anchor) return;
    this.space = crypto.randomUUID();
    registered.value = null;
    this.step = "sweep";
    this.write();
  }

  dispose(): void {
    this.forget();
    this.session.removeEventListener("selectstart", this.press);
    this.session.removeEventListener("selectend", this.release);
    this.session.removeEventListener("squeezestart", this.takeBack);
    this.texture.dispose();
    this.mark.removeFromParent();
    for (const { geometry } of [this.panel, this.mark]) geometry.dispose();
    (this.panel.material as MeshBasicMaterial).dispose();
  }

  private get landmark() {
    const all = this.step === "seen" ? boards() : (scene.peek()?.landmarks ?? []);
    return all[this.index % Math.max(all.length, 1)];
  }

  /** Ways by which this cell can be found: a board has to be told of. */
  private get ways(): readonly (typeof WAYS)[number][] {
    return boards().length > 0 ? WAYS : WAYS.slice(0, -1);
  }

  private ask(step: string, more: Partial<Register> = {}): void {
    this.number += 1;
    this.waits = true;
    this.said = "";
    const none = { landmark: "", poses: new Uint8Array(), corners: new Uint8Array(), by: [] };
    const { number: id, space, human } = this;
    this.send({ type: "register", id, human: human ?? "", space, step, ...none, ...more });
  }

  private readonly press = ({ inputSource }: XRInputSourceEvent): void => {
    if (!this.active || this.waits || this.step === "align") return;
    this.pressedAt = this.now;
    if (this.step === "seen") this.looks = mayLook(this.session);
    else if (inputSource.hand) this.said = word("take a controller: a finger is not good enough");
    else if (this.step === "strapped" || this.step === "known") {
      // Whoever pulled its own trigger would move it.
      this.hand = this.other(inputSource.handedness);
      this.pressed = { hand: this.hand, since: this.now, poses: [] };
    } else if (this.step !== "sweep" && inputSource.handedness !== this.hand)
      this.said = word("use the controller that you turned about its tip");
    else {
      this.hand = inputSource.handedness;
      this.pressed = { hand: this.hand, since: this.now, poses: [] };
    }
    this.write();
  };

  private readonly release = ({ inputSource }: XRInputSourceEvent): void => {
    if (this.step === "sweep" && this.pressed?.hand === inputSource.handedness) this.finish();
    if (inputSource.targetRayMode === "screen" && this.now - this.pressedAt > LONG_MS) this.next();
  };

  /** Look at a board with the device's own camera, in this picture. */
  private lookNow(frame: XRFrame, floor: XRReferenceSpace): void {
    this.looks = false;
    const gl = this.viewer.stage.renderer.getContext() as WebGL2RenderingContext;
    const seen = look(this.session, frame, floor, gl);
    const { landmark } = this;
    if (seen && landmark) void this.tellLook(seen, landmark.name, landmark.board);
    else {
      this.said = word("this device hands over no picture of its camera");
      this.write();
    }
  }

  private async tellLook(seen: Look, landmark: string, board: string): Promise<void> {
    const pose = new Float32Array(this.inRoom(seen.pose));
    this.waits = true;
    this.said = word("looking …");
    this.write();
    const corners = await cornersIn(seen, board);
    this.waits = false;
    if (typeof corners === "string") {
      this.said = corners;
      this.write();
    } else this.ask("seen", { landmark, poses: new Uint8Array(pose.buffer), corners, by: seen.lens });
  }

  /** The other controller, where there is one. */
  private other(hand: XRHandedness): XRHandedness {
    const all = [...this.session.inputSources].filter((one) => one.gripSpace && !one.hand);
    return all.find(({ handedness }) => handedness !== hand && handedness !== "none")?.handedness ?? hand;
  }

  private readonly takeBack = (): void => {
    if ((this.step === "touch" || this.step === "seen") && !this.waits) this.ask("drop");
    if (this.step === "strapped" && !this.waits) this.ask("forget");
  };

  /** What one controller does: poses while its trigger is held, sticks, and the button that ends. */
  private follow(frame: XRFrame, floor: XRReferenceSpace, source: XRInputSource): void {
    const { handedness, gripSpace, gamepad } = source;
    const held = this.pressed;
    const pose = held?.hand === handedness && gripSpace ? frame.getPose(gripSpace, floor) : null;
    if (held && pose && !pose.emulatedPosition) {
      held.poses.push(this.inRoom(pose.transform));
      if (this.step === "sweep" ? held.poses.length >= MOST_SWEEP : this.now - held.since >= HELD_MS)
        this.finish();
    }
    const [x, y] = [gamepad?.axes[2] ?? 0, gamepad?.axes[3] ?? 0];
    this.stick(`${handedness} x`, x, (way) => this.pushX(handedness, way));
    this.stick(`${handedness} y`, y, (way) => this.pushY(handedness, way));
    this.stick(`${handedness} done`, gamepad?.buttons[DONE]?.pressed ? 1 : 0, () => this.next());
  }

  private inRoom({ matrix }: XRRigidTransform): number[] {
    this.moved.fromArray(matrix).premultiply(this.roomFromFloor).decompose(this.at, this.turn, new Vector3());
    const { x, y, z, w } = this.turn;
    return [...this.at.toArray(), w, x, y, z];
  }

  private stick(key: string, value: number, act: (way: number) => void): void {
    if (Math.abs(value) > PUSHED && !this.pushed.has(key)) {
      this.pushed.add(key);
      act(Math.sign(value));
    } else if (Math.abs(value) < RELEASED) this.pushed.delete(key);
  }

  private pushX(hand: XRHandedness, way: number): void {
    if (AT_LANDMARK.includes(this.step)) {
      const count = (this.step === "seen" ? boards() : (scene.peek()?.landmarks ?? [])).length || 1;
      this.index = (this.index + way + count) % count;
      this.write();
    } else if (this.step === "align")
      this.nudge(hand === "left" ? [way * NUDGE, 0, 0, 0, 0, 0] : [0, 0, 0, 0, 0, -way * NUDGE_TURN]);
  }

  private pushY(hand: XRHandedness, way: number): void {
    const { ways } = this;
    const now = ways.indexOf(this.step as (typeof WAYS)[number]);
    if (now >= 0 && !this.waits && !this.pressed) {
      this.step = ways[(now + way + ways.length) % ways.length]!;
      this.index = 0;
      this.write();
    }
    if (this.step === "align")
      this.nudge([0, hand === "left" ? -way * NUDGE : 0, hand === "left" ? 0 : -way * NUDGE, 0, 0, 0]);
  }

  private nudge(by: number[]): void {
    if (!this.waits) this.ask("nudge", { by });
  }

  private next(): void {
    const known = registered.peek();
    if (SOLVED.includes(this.step) && known?.error != null && !known.doubt) this.step = "align";
    else if (this.step === "align") {
      this.step = "done";
      void this.keep();
    }
    this.write();
  }

  private finish(): void {
    const { poses } = this.pressed!;
    this.pressed = null;
    if (poses.length === 0) {
      this.said = word("the controller was not seen: turn to it, and try again");
      this.write();
      return;
    }
    const most = this.step === "sweep" ? MOST_SWEEP : MOST_TOUCH;
    const every = Math.ceil(poses.length / most);
    const some = poses.filter((_, k) => k % every === 0);
    const bytes = new Uint8Array(new Float32Array(some.flat()).buffer);
    if (this.step === "sweep") this.ask("sweep", { poses: bytes });
    else this.ask(this.step, { landmark: this.landmark?.name ?? "", poses: bytes });
  }

  private hear(answer: Registered | null): void {
    if (answer && answer.id === this.number) {
      this.waits = false;
      this.said = answer.accepted ? "" : answer.reason;
      if (answer.accepted && this.step === "sweep") this.swept();
      else if (answer.accepted && this.step === "touch") this.index = answer.landmarks.length;
      else if (answer.accepted && this.step === "check" && !answer.doubt) this.step = "align";
    }
    this.write();
  }

  private swept(): void {
    this.step = this.kept ? "check" : "touch";
    this.index = 0;
  }

  private show(): void {
    const next = AT_LANDMARK.includes(this.step) ? this.landmark : undefined;
    this.panel.visible = this.active;
    this.mark.visible = next !== undefined;
    if (!next) return;
    this.mark.position.set(...next.position);
    const node = this.viewer.bodies.byName.get(next.node)?.group;
    if (node) this.mark.position.applyMatrix4(node.matrix);
  }

  /** Hang the room on an anchor: what the device learns of its surroundings then moves nothing. */
  private async settle(frame: XRFrame, floor: XRReferenceSpace): Promise<void> {
    if (this.anchor || this.anchoring || this.step !== "sweep" || !frame.createAnchor) return;
    this.anchoring = true;
    try {
      const anchor = await frame.createAnchor(new XRRigidTransform(), floor);
      if (anchor && this.step === "sweep") this.anchor = anchor;
    } catch {
      // Without anchors the room holds until the next recentring.
    }
  }

  private async keep(): Promise<void> {
    const known = registered.peek();
    const handle = await (this.anchor as Kept | null)?.requestPersistentHandle?.().catch(() => undefined);
    if (!handle || !known) return;
    const by = [...known.at, ...known.about, ...known.covariance];
    localStorage.setItem(keptName(), JSON.stringify({ handle, by }));
  }

  private async restore(): Promise<void> {
    const kept = readKept();
    const again = (this.session as Restores).restorePersistentAnchor?.bind(this.session);
    if (!kept || !again) return;
    try {
      this.anchor = await again(kept.handle);
      this.kept = kept.handle;
      this.ask("restore", { by: kept.by });
    } catch {
      localStorage.removeItem(keptName());
    }
  }

  private write(): void {
    const { brush } = this;
    const { width, height } = PIXELS;
    brush.clearRect(0, 0, width, height);
    brush.fillStyle = "rgba(13, 19, 28, 0.92)";
    brush.fillRect(0, 0, width, height);
    this.lines.forEach((line, k) => {
      brush.font = k === 0 ? "bold 58px sans-serif" : "40px sans-serif";
      brush.fillStyle = k > 2 ? "#fbe36a" : "#dbe3ee";
      brush.fillText(line, 30, 90 + 78 * k, width - 60);
    });
    this.texture.needsUpdate = true;
  }
}

/** Where the room lies in the world (z up): what the server found out, of the room's own x ahead and z up. */
export function placeOfRoom(at: readonly number[], into: Matrix4): Matrix4 {
  const [x, y, z, qw, qx, qy, qz] = at as [number, number, number, number, number, number, number];
  return into.compose(new Vector3(x, y, z), new Quaternion(qx, qy, qz, qw), ONE);
}

/** Landmarks at which a printed board lies. */
function boards() {
  return (scene.peek()?.landmarks ?? []).filter(({ board }) => board !== "");
}

function keptName(): string {
  return `seerob room ${scene.peek()?.title ?? ""}`;
}

function readKept(): { handle: string; by: number[] } | null {
  try {
    const kept = JSON.parse(localStorage.getItem(keptName()) ?? "null");
    return typeof kept?.handle === "string" && kept.by?.length === 46 ? kept : null;
  } catch {
    return null;
  }
}
