// A visit in the room: a WebXR session in which the twin stands around the visitor, who looks at it or is a
// person of it. One model, two views: what the panels of the page show, the room shows.

import { effect } from "@preact/signals";
import {
  BufferGeometry,
  Group,
  Line,
  Matrix4,
  Mesh,
  Quaternion,
  Raycaster,
  RingGeometry,
  SphereGeometry,
  Vector3,
} from "three";
import { ownScale } from "../company";
import { ask, draft, mayEdit } from "../editing/draft";
import { gizmoMode } from "../editing/handles";
import { hidden, isLive, lookingAt, overReality, registered, rows, scene, transport } from "../page_state";
import { ALONE_LAYER } from "../scene/crowds";
import { markLine, markMaterial } from "../scene/materials";
import type { Sighted } from "../scene/own_presence";
import { nodeAlong } from "../scene/picking";
import type { Viewer } from "../scene/viewer";
import type { TimeControl } from "../time_control";
import { mayMeasure, measuring, toggleMeasure } from "../view/measure";
import type { Register, Tracking } from "../wire";
import { said, word } from "../words";
import { Board } from "./board";
import { BodyBoard } from "./body_board";
import { isOn, leftHanded, seated, smooth, sound, tone, turnOver, vignette } from "./comfort";
import { Designing } from "./designing";
import { Fitting } from "./fitting";
import { Hands } from "./hands";
import { Ghost, Ruler, Section, Vignette } from "./instruments";
import { type Item, Menu } from "./menu";
import type { Panel } from "./panel";
import { PlotPanel } from "./plot_panel";
import { placeOfRoom, Registering } from "./registering";
import { ReviewPanel } from "./review_panel";
import { bodyJoints, sight } from "./sight";

export type Mode = "immersive-vr" | "immersive-ar";

const MODES: readonly Mode[] = ["immersive-vr", "immersive-ar"];
const WANTED: XRSessionInit = {
  requiredFeatures: ["local-floor"],
  optionalFeatures: ["hand-tracking", "body-tracking", "anchors"],
};
/** The device's world as sources have it (x ahead, y to the left, z up) from that of WebXR (y up, -z ahead). */
const AHEAD = new Matrix4().set(0, 0, -1, 0, -1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 1);
/** One turn of a thumb stick, and how far it must be pushed and come back. */
const SNAP = Math.PI / 6;
const PUSHED = 0.7;
const RELEASED = 0.3;
/** A beam is no longer [m]. */
const FARTHEST = 12;
const PULSE = { strength: 0.7, ms: 150 };
const TAKEN = { strength: 0.3, ms: 40 };
const OVER_WRIST = new Vector3(0, 0.14, -0.05);
const OVER_MENU = new Vector3(0, 0.44, -0.07);
/** Between two panels [m]. */
const GAP = 0.01;
/** Turning while the stick is pushed [rad/s], and eyes of one who stands [m]. */
const TURNING = Math.PI / 2;
const STANDING = 1.6;
const FACING = new Vector3(0, 1.3, -1.1);

/** The kinds of session that this browser can begin. */
export async function sessionModes(): Promise<Mode[]> {
  const { xr } = navigator;
  if (!xr) return [];
  const there = await Promise.all(MODES.map((mode) => xr.isSessionSupported(mode).catch(() => false)));
  return MODES.filter((_, i) => there[i]);
}

/** What a visitor holds: a ball where the hand is, and a beam to where it points. */
class Pointer {
  readonly ball = new Mesh(new SphereGeometry(0.022, 16, 10), markMaterial("held"));
  readonly beam = new Line(
    new BufferGeometry().setFromPoints([new Vector3(), new Vector3(0, 0, -1)]),
    markLine(false),
  );
  /** Where it points from, and which way, in the world. */
  readonly from = new Vector3();
  readonly along = new Vector3();
  turned = false;
  walking = false;

  constructor() {
    this.ball.visible = false;
    this.beam.visible = false;
    this.beam.frustumCulled = false;
  }
}

export class Visit implements Sighted {
  private readonly rig: Group;
  private readonly things = new Group();
  private readonly pointers = { left: new Pointer(), right: new Pointer() };
  private readonly landing = new Mesh(
    new RingGeometry(0.16, 0.22, 32).rotateX(-Math.PI / 2),
    markMaterial("solid"),
  );
  private readonly board = new Board();
  private readonly hands: Hands;
  private readonly menu: Menu;
  private readonly plot = new PlotPanel();
  private readonly bodyMap = new BodyBoard();
  private readonly review = new ReviewPanel();
  /** Panels that are shown when asked for. */
  private readonly aside: readonly Panel[];
  private readonly designing: Designing;
  private readonly ruler = new Ruler();
  private readonly section: Section;
  private readonly ghost: Ghost;
  private readonly vignette = new Vignette();
  private measures = false;
  private shines = false;
  private moved = false;
  private raised = 0;
  private tickedAt = 0;
  private elapsed = 0;
  private readonly ray = new Raycaster();
  /** Finds out where the room lies; null where nothing has to be found. */
  readonly registering: Registering | null = null;
  /** Fits the person of the twin to the visitor; null for one who looks. */
  readonly fitting: Fitting | null;
  private readonly before: () => void;
  private readonly forget: () => void;
  private exceeded: ReadonlySet<string> = new Set();
  // Made once: a picture allocates nothing of ours.
  private readonly eyes = new Vector3();
  private readonly facing = new Quaternion();
  private frame: XRFrame | null = null;
  private readonly at = new Vector3();
  private readonly turn = new Quaternion();
  private readonly up = new Vector3(0, 1, 0);

  private constructor(
    readonly session: XRSession,
    readonly mode: Mode,
    /** The person that the visitor is; null for one who looks. */
    readonly human: string | null,
    private readonly viewer: Viewer,
    private readonly send: (message: Tracking | Register) => void,
    private readonly time: TimeControl,
  ) {
    const { stage } = viewer;
    this.rig = stage.rig;
    this.before = this.remember();
    this.section = new Section(stage);
    this.ghost = new Ghost(stage, viewer.bodies);
    this.designing = new Designing(viewer);
    this.fitting = human === null ? null : new Fitting(human, () => this.stand());
    this.aside = [this.plot, this.bodyMap, this.review, ...(this.fitting ? [this.fitting] : [])];
    this.menu = new Menu([...this.items(), ...(mayEdit.peek() ? this.edits() : [])]);
    for (const { mesh } of this.aside) mesh.visible = false;
    this.things.add(this.board.mesh, this.landing, this.menu.mesh, this.vignette.mesh);
    this.things.add(...this.aside.map(({ mesh }) => mesh));
    stage.scene.add(this.ruler.root);
    for (const { ball, beam } of Object.values(this.pointers)) this.things.add(ball, beam);
    this.landing.visible = false;
    this.rig.add(this.things);
    // Over the real cell the twin has to lie where that is.
    if (mode === "immersive-ar" && scene.peek()?.landmarks.length)
      this.registering = new Registering(session, viewer, human, send);
    if (this.registering) {
      this.things.add(this.registering.panel);
      viewer.stage.world.add(this.registering.mark);
    }
    this.stand();
    const forgets = [effect(() => this.feel()), effect(() => this.resize(ownScale.value))];
    this.forget = () => {
      for (const forget of forgets) forget();
    };
    this.hands = new Hands(viewer, human);
    for (const kind of ["select", "squeeze"] as const) {
      session.addEventListener(`${kind}start`, this.close);
      session.addEventListener(`${kind}end`, this.open);
    }
  }

  /**
   * Begin a session; only a press of the user may.
   *
   * @param human Who the visitor is; null for one who looks.
   * @param send Takes what the headset sees of that person.
   */
  static async begin(
    viewer: Viewer,
    mode: Mode,
    human: string | null,
    send: (message: Tracking | Register) => void,
    time: TimeControl,
  ): Promise<Visit> {
    if (!navigator.xr) throw new Error("this browser has no headset");
    // Whoever is asked for the camera wants to know why: only where a board is there to be seen.
    const boards = mode === "immersive-ar" && scene.peek()?.landmarks.some(({ board }) => board !== "");
    const wanted = boards
      ? { ...WANTED, optionalFeatures: [...WANTED.optionalFeatures!, "camera-access"] }
      : WANTED;
    const session = await navigator.xr.requestSession(mode, wanted);
    const { xr } = viewer.stage.renderer;
    const visit = new Visit(session, mode, human, viewer, send, time);
    xr.enabled = true;
    xr.setReferenceSpaceType("local-floor");
    await xr.setSession(session);
    // After three.js has heard it: until then the camera is the headset's.
    session.addEventListener("end", () => visit.end());
    xr.getReferenceSpace()?.addEventListener("reset", () => visit.registering?.recentred());
    return visit;
  }

  /** Once per picture of the session, before it is drawn. */
  tick(time: number, frame: XRFrame | undefined): void {
    const space = this.viewer.stage.renderer.xr.getReferenceSpace();
    if (!frame || !space) return;
    const { registering } = this;
    registering?.tick(time, frame, space);
    if (registering && registered.peek()?.at.length) this.stand();
    if (this.human !== null) {
      const sources = this.session.inputSources;
      this.fitting!.tick(time, frame, space, sources);
      const name = registering?.space ?? "";
      const { roomFromFloor } = registering ?? this.fitting!;
      const seen = sight(frame, space, sources, this.human, time, name, roomFromFloor);
      if (seen) {
        seen.scale = this.rig.scale.x;
        seen.stands = this.fitting!.stands;
        this.send(seen);
      }
    }
    const viewer = frame.getViewerPose(space);
    if (viewer) {
      const { position: p, orientation: q } = viewer.transform;
      this.eyes.set(p.x, p.y, p.z);
      this.facing.set(q.x, q.y, q.z, q.w);
      const veil = this.vignette.mesh;
      veil.quaternion.copy(this.facing);
      veil.position.set(0, 0, -0.2).applyQuaternion(this.facing).add(this.eyes);
    }
    this.frame = frame;
    this.elapsed = Math.min(Math.max((time - this.tickedAt) / 1000, 0), 0.1);
    this.tickedAt = time;
    this.moved = false;
    this.rig.updateMatrixWorld();
    const { left, right } = this.pointers;
    left.ball.visible = left.beam.visible = right.ball.visible = right.beam.visible = false;
    this.landing.visible = false;
    this.sit();
    const { inputSources } = this.session;
    for (let k = 0; k < inputSources.length; k += 1) this.hold(frame, space, inputSources[k]!);
    const { menu, board } = this;
    const wrist = this.pointers[leftHanded.value === "on" ? "right" : "left"].ball;
    menu.mesh.visible = wrist.visible;
    if (wrist.visible) {
      menu.mesh.position.copy(wrist.position).add(OVER_WRIST);
      board.mesh.position.copy(wrist.position).add(OVER_MENU);
    } else board.mesh.position.copy(FACING);
    this.rig.localToWorld(this.at.copy(this.eyes));
    registering?.panel.lookAt(this.at);
    menu.mesh.lookAt(this.at);
    board.mesh.lookAt(this.at);
    // One above the other, over the board.
    let top = board.mesh.position.y + 0.5 * board.height;
    for (let k = 0; k < this.aside.length; k += 1) {
      const panel = this.aside[k]!;
      if (!panel.mesh.visible) continue;
      panel.mesh.position.copy(board.mesh.position).y = top + 0.5 * panel.height + GAP;
      panel.mesh.lookAt(this.at);
      top += panel.height + GAP;
    }
    this.vignette.update(this.moved && vignette.value === "on", this.elapsed);
    menu.update(time);
    board.update(time);
    for (let k = 0; k < this.aside.length; k += 1) this.aside[k]!.update(time);
    if (measuring.peek()) this.ruler.tell();
    this.viewer.stage.invalidate();
  }

  /** Where the floor of the visitor's room lies in the world (y up), and how large the visitor is. */
  stand(): void {
    const { rig, viewer, human } = this;
    const found = this.registering && registered.peek();
    if (found?.at.length) {
      viewer.stage.world.updateMatrix();
      placeOfRoom(found.at, rig.matrix).premultiply(viewer.stage.world.matrix).multiply(AHEAD);
      rig.matrix.multiply(this.registering!.roomFromFloor).decompose(rig.position, rig.quaternion, rig.scale);
      return;
    }
    const placed = human === null ? null : scene.peek()?.headsets[human];
    if (placed) {
      const [x, y, z, qw, qx, qy, qz] = placed;
      this.turn.set(qx, qy, qz, qw);
      rig.matrix.compose(this.at.set(x, y, z), this.turn, new Vector3(1, 1, 1));
      viewer.stage.world.updateMatrix();
      rig.matrix.premultiply(viewer.stage.world.matrix).multiply(AHEAD);
      if (this.fitting && !this.registering) rig.matrix.multiply(this.fitting.roomFromFloor);
      rig.matrix.decompose(rig.position, rig.quaternion, rig.scale);
      rig.scale.setScalar(ownScale.peek());
      return;
    }
    const { camera } = viewer.stage;
    camera.getWorldDirection(this.at);
    rig.quaternion.setFromAxisAngle(this.up, Math.atan2(-this.at.x, -this.at.z));
    camera.getWorldPosition(rig.position).setY(0);
    rig.scale.setScalar(ownScale.peek());
  }

  /** Be so large from now on, with the head above the same point of the floor. */
  private resize(scale: number): void {
    const { rig } = this;
    if (rig.scale.x === scale) return;
    rig.updateMatrixWorld();
    rig.localToWorld(this.at.copy(this.eyes));
    const { x, z } = this.at;
    rig.scale.setScalar(scale);
    rig.updateMatrixWorld();
    rig.localToWorld(this.at.copy(this.eyes));
    // A person of the twin stands where the file says.
    if (this.human === null)
      rig.position.set(rig.position.x + x - this.at.x, rig.position.y, rig.position.z + z - this.at.z);
    rig.updateMatrixWorld();
  }

  // -- what the others are told, in the space of the rig ------------------------------------------

  head(position: Vector3, turn: Quaternion): boolean {
    position.copy(this.eyes);
    turn.copy(this.facing);
    return this.frame !== null;
  }

  hand(side: "left" | "right", position: Vector3, turn: Quaternion): boolean {
    const { ball } = this.pointers[side];
    position.copy(ball.position);
    turn.copy(ball.quaternion);
    return ball.visible;
  }

  joints(into: Float32Array): number {
    const space = this.viewer.stage.renderer.xr.getReferenceSpace();
    return this.frame && space ? bodyJoints(this.frame, space, this.session.inputSources, into) : 0;
  }

  laser(from: Vector3, to: Vector3): boolean {
    const { right, left } = this.pointers;
    const { beam } = right.beam.visible ? right : left;
    if (!beam.visible) return false;
    from.copy(beam.position);
    to.set(0, 0, -beam.scale.x).applyQuaternion(beam.quaternion).add(beam.position);
    return true;
  }

  /** Where a point of the visitor's room [m] is in the world (y up). */
  inWorld(point: [number, number, number]): [number, number, number] {
    this.rig.updateMatrixWorld();
    return this.rig.localToWorld(new Vector3(...point)).toArray();
  }

  /** Where a point of the world (y up) is in the visitor's room [m]. */
  inRoom(point: [number, number, number]): [number, number, number] {
    this.rig.updateMatrixWorld();
    return this.rig.worldToLocal(new Vector3(...point)).toArray();
  }

  private hold(frame: XRFrame, space: XRReferenceSpace, source: XRInputSource): void {
    if (source.handedness !== "left" && source.handedness !== "right") return;
    const pointer = this.pointers[source.handedness];
    const wrist = source.hand?.get("wrist") ?? source.gripSpace;
    const held = wrist && frame.getPose(wrist, space);
    if (held) {
      const { x, y, z } = held.transform.position;
      const { orientation: q } = held.transform;
      pointer.ball.position.set(x, y, z);
      pointer.ball.quaternion.set(q.x, q.y, q.z, q.w);
      // A person of the twin has hands there.
      pointer.ball.visible = true;
      this.hands.move(source.handedness, pointer.ball.getWorldPosition(this.at));
      this.designing.move(source.handedness, pointer.ball.matrixWorld);
    }
    const aimed = frame.getPose(source.targetRaySpace, space);
    if (!aimed) return;
    const { position: p, orientation: q } = aimed.transform;
    pointer.beam.position.set(p.x, p.y, p.z);
    pointer.beam.quaternion.set(q.x, q.y, q.z, q.w);
    this.rig.localToWorld(pointer.from.set(p.x, p.y, p.z));
    pointer.along
      .set(0, 0, -1)
      .applyQuaternion(pointer.beam.quaternion)
      .transformDirection(this.rig.matrixWorld);
    this.ray.set(pointer.from, pointer.along);
    const onMenu = this.menu.mesh.visible && this.wrist !== source.handedness && this.menu.point(this.ray);
    if (onMenu || this.shines) {
      pointer.beam.visible = true;
      pointer.beam.scale.setScalar(this.shines && !onMenu ? this.meets(pointer) : 0.6);
    }
    // Who is a person of the twin, or in the real cell, goes on their own feet.
    if (this.human === null && !this.registering) this.steer(pointer, source.gamepad);
  }

  /** The hand at whose wrist the menu is. */
  private get wrist(): "left" | "right" {
    return leftHanded.peek() === "on" ? "right" : "left";
  }

  /** Put a seated visitor who looks as high as one who stands; a person of the twin sits where they sit. */
  private sit(): void {
    const wanted = this.human === null && seated.value === "on" && this.eyes.y > 0;
    const raise = wanted ? this.raised || Math.max(0, STANDING - this.eyes.y) : 0;
    if (raise === this.raised) return;
    this.rig.position.y += (raise - this.raised) * this.rig.scale.y;
    this.raised = raise;
    this.rig.updateMatrixWorld();
  }

  /** How far a beam goes until it meets something [m] of the visitor's room. */
  private meets({ from, along }: Pointer): number {
    this.ray.set(from, along);
    this.ray.layers.enable(ALONE_LAYER);
    const [hit] = this.ray.intersectObject(this.viewer.bodies.root, true);
    return Math.min(hit?.distance ?? FARTHEST, FARTHEST) / this.rig.scale.x;
  }

  private items(): Item[] {
    const { time, ruler, ghost, section } = this;
    const choice = (words: string, of: typeof smooth): Item => ({
      label: () => said(words),
      on: () => isOn(of),
      press: () => turnOver(of),
    });
    return [
      { label: () => "− 1 s", press: () => time.seekBy(-1) },
      { label: () => said(isPlaying() ? word("hold") : word("play")), press: () => time.toggle() },
      { label: () => "+ 1 s", press: () => time.seekBy(1) },
      {
        label: () => said(isLive.peek() ? word("now") : word("begin")),
        press: () => (isLive.peek() ? time.follow() : time.begin()),
      },
      { label: () => said("last limit"), press: () => time.violation(false) },
      { label: () => said("next limit"), press: () => time.violation(true) },
      { label: () => said("ghost"), on: () => ghost.on, press: () => ghost.turnOver() },
      showing(word("plot"), this.plot),
      showing(word("body map"), this.bodyMap),
      {
        label: () => said("ruler"),
        on: () => this.measures,
        press: () => {
          this.measures = !this.measures;
          ruler.clear();
          // The engine is asked, as on the desk.
          if (this.measures === (measuring.peek() === null) && (mayMeasure.peek() || !this.measures))
            toggleMeasure();
        },
      },
      {
        label: () => said("section"),
        on: () => section.on,
        press: () => {
          // Across the way one looks, half a metre ahead.
          const ahead = this.vignette.mesh.getWorldDirection(new Vector3()).negate();
          const at = this.rig.localToWorld(this.eyes.clone()).addScaledVector(ahead, 0.5);
          section.turnOver(at, ahead);
        },
      },
      {
        label: () => said("laser"),
        on: () => this.shines,
        press: () => {
          this.shines = !this.shines;
        },
      },
      ...this.fits(),
      choice(word("sound"), sound),
      choice(word("smooth"), smooth),
      choice(word("vignette"), vignette),
      choice(word("seated"), seated),
      choice(word("left hand"), leftHanded),
      { label: () => said("leave"), press: () => void this.session.end() },
    ];
  }

  /** What else is at the wrist of whoever is a person of the twin. */
  private fits(): Item[] {
    const { fitting } = this;
    if (!fitting) return [];
    return [
      {
        label: () => said("fit me"),
        on: () => fitting.active,
        press: () => fitting.begin(),
      },
      {
        label: () => said(fitting.stature() === null ? word("hide") : word("my stature")),
        press: () => {
          fitting.keepStature();
          fitting.mesh.visible = false;
        },
      },
    ];
  }

  /** What else is at the wrist of whoever may edit the workstation file. */
  private edits(): Item[] {
    const { designing, review } = this;
    return [
      {
        label: () => said("design"),
        on: () => designing.on,
        press: () => {
          designing.on = !designing.on;
          if (!designing.on) designing.teaches = false;
        },
      },
      {
        label: () => said("turn"),
        on: () => gizmoMode.value === "turn",
        press: () => {
          gizmoMode.value = gizmoMode.peek() === "turn" ? "move" : "turn";
        },
      },
      {
        label: () => said("teach"),
        on: () => designing.teaches,
        press: () => {
          designing.teaches = !designing.teaches;
          designing.on ||= designing.teaches;
        },
      },
      { label: () => said("undo"), press: () => void ask("undo") },
      { label: () => said("redo"), press: () => void ask("redo") },
      showing(word("review"), review),
      {
        // Nobody saves what they have not seen.
        label: () => said(review.mesh.visible ? word("save") : word("review, then save")),
        press: () => {
          if (review.mesh.visible) void ask("save");
          else review.mesh.visible = true;
        },
      },
      {
        label: () => said(draft.value?.runs ? word("stop") : word("run")),
        press: () => void ask(draft.peek()?.runs ? "stop" : "run"),
      },
    ];
  }

  /** What is written on the panels that are shown, and on the ruler, as it was drawn last. */
  get panels(): string[] {
    const shown = [this.board, ...this.aside].filter(({ mesh }) => mesh.visible);
    return [...shown.flatMap(({ written }) => written), this.ruler.text].filter((text) => text !== "");
  }

  /** Where the middle of a button of the menu is in the world; null where there is none. */
  button(label: string): [number, number, number] | null {
    const middle = this.menu.middle(label);
    this.menu.mesh.updateWorldMatrix(true, false);
    return middle && this.menu.mesh.localToWorld(new Vector3(...middle)).toArray();
  }

  /** Turn at a push to the side, go where one points at a push ahead that is let go. */
  private steer(pointer: Pointer, gamepad: Gamepad | undefined): void {
    const x = gamepad?.axes[2] ?? 0;
    const y = gamepad?.axes[3] ?? 0;
    if (smooth.value === "on" && Math.abs(x) > RELEASED) {
      this.turnBy(-x * TURNING * this.elapsed);
      this.moved = true;
    } else if (Math.abs(x) > PUSHED && !pointer.turned) {
      this.turnBy(-Math.sign(x) * SNAP);
      this.moved = true;
    }
    pointer.turned = Math.abs(x) > (pointer.turned ? RELEASED : PUSHED);
    const floor = this.floor(pointer);
    const pushed = y < -(pointer.walking ? RELEASED : PUSHED);
    if (pushed && floor) {
      pointer.beam.visible = true;
      pointer.beam.scale.setScalar(floor.distanceTo(pointer.from) / this.rig.scale.x);
      this.landing.visible = true;
      this.landing.position.copy(this.rig.worldToLocal(this.at.copy(floor))).y += 0.005;
    }
    if (pointer.walking && !pushed && floor) {
      this.go(floor);
      this.moved = true;
    }
    pointer.walking = pushed;
  }

  private readonly landed = new Vector3();

  /** Where a pointer meets the floor, in the world; null where it does not. */
  private floor({ from, along }: Pointer): Vector3 | null {
    const far = -from.y / along.y;
    if (!(far > 0 && far < FARTHEST * this.rig.scale.x)) return null;
    return this.landed.copy(from).addScaledVector(along, far);
  }

  private turnBy(angle: number): void {
    const { rig } = this;
    rig.localToWorld(this.at.copy(this.eyes));
    const { x, z } = this.at;
    rig.quaternion.premultiply(this.turn.setFromAxisAngle(this.up, angle));
    rig.updateMatrixWorld();
    rig.localToWorld(this.at.copy(this.eyes));
    rig.position.x += x - this.at.x;
    rig.position.z += z - this.at.z;
    rig.updateMatrixWorld();
  }

  /** Stand with the head above a point of the floor. */
  private go(floor: Vector3): void {
    const { rig } = this;
    rig.localToWorld(this.at.copy(this.eyes));
    rig.position.x += floor.x - this.at.x;
    rig.position.z += floor.z - this.at.z;
    rig.position.y = floor.y;
    rig.updateMatrixWorld();
  }

  private readonly close = ({ inputSource, type }: XRInputSourceEvent): void => {
    if (this.registering?.active) return;
    const side = inputSource.handedness;
    if (side !== "left" && side !== "right") return;
    const { ball, from, along } = this.pointers[side];
    this.ray.set(from, along);
    if (type === "selectstart" && side !== this.wrist && this.menu.press(this.ray)) {
      pulse(inputSource, TAKEN);
      return;
    }
    if (this.fitting?.active) {
      if (type === "selectstart") this.fitting.press(inputSource, this.session.inputSources);
      return;
    }
    if (type === "selectstart" && this.measures) {
      const met = measuring.peek()
        ? this.ruler.ask(this.ray, this.viewer)
        : this.ruler.take(this.ray, this.viewer.bodies);
      if (met) pulse(inputSource, TAKEN);
      return;
    }
    ball.updateWorldMatrix(true, false);
    const taken =
      this.designing.close(side, nodeAlong(this.ray, this.viewer.bodies), ball.matrixWorld) ||
      (!this.designing.on && this.hands.close(side, ball.getWorldPosition(this.at), from, along));
    if (taken) pulse(inputSource, TAKEN);
    if (taken || type !== "selectstart") return;
    this.ray.set(from, along);
    this.viewer.pick(this.ray);
  };

  private readonly open = ({ inputSource }: XRInputSourceEvent): void => {
    const side = inputSource.handedness;
    this.hands.open(side);
    if (side !== "none") this.designing.open(side);
  };

  /** A pulse in both hands as soon as a limit is exceeded. */
  private feel(): void {
    const now = new Set(rows.value.filter(({ state }) => state === "exceeded").map(({ info }) => info.name));
    const more = [...now].some((name) => !this.exceeded.has(name));
    this.exceeded = now;
    if (!more) return;
    if (sound.peek() === "on") tone();
    for (const source of this.session.inputSources) pulse(source, PULSE);
  }

  /** What the room changes outside, and how to put it back. */
  private remember(): () => void {
    const { stage, viewpoint } = this.viewer;
    const { camera, scene: room } = stage;
    const { fov } = camera;
    const [place, turn] = [camera.position.clone(), camera.quaternion.clone()];
    const { background, fog } = room;
    const over = overReality.peek();
    const head = this.human === null ? null : `${this.human}/head`;
    viewpoint.controls.enabled = false;
    // Nobody sees their own head from within.
    if (head !== null) hidden.value = new Set([...hidden.peek(), head]);
    if (this.mode === "immersive-ar") {
      room.background = null;
      room.fog = null;
      overReality.value = true;
    }
    return () => {
      room.background = background;
      room.fog = fog;
      overReality.value = over;
      if (head !== null) hidden.value = new Set([...hidden.peek()].filter((name) => name !== head));
      camera.position.copy(place);
      camera.quaternion.copy(turn);
      camera.fov = fov;
      viewpoint.controls.enabled = true;
    };
  }

  private end(): void {
    const { rig, things, viewer } = this;
    this.forget();
    this.hands.end();
    this.designing.end();
    if (this.measures && measuring.peek()) toggleMeasure();
    viewer.stage.scene.remove(this.ruler.root);
    this.section.clear();
    this.ghost.clear();
    for (const each of [this.menu, ...this.aside, this.ruler, this.vignette]) each.dispose();
    rig.remove(things);
    rig.position.set(0, 0, 0);
    rig.quaternion.identity();
    rig.scale.setScalar(1);
    this.board.dispose();
    this.registering?.dispose();
    for (const { ball, beam } of Object.values(this.pointers))
      for (const each of [ball, beam]) each.geometry.dispose();
    this.before();
    viewer.stage.renderer.xr.enabled = false;
    viewer.stage.resize();
  }
}

function showing(words: string, { mesh }: Panel): Item {
  return {
    label: () => said(words),
    on: () => mesh.visible,
    press: () => {
      mesh.visible = !mesh.visible;
    },
  };
}

function isPlaying(): boolean {
  return isLive.peek() ? lookingAt.peek() === null : transport.peek().playing;
}

function pulse({ gamepad }: XRInputSource, { strength, ms }: typeof PULSE): void {
  const [actuator] = (gamepad?.hapticActuators ?? []) as unknown as { pulse?: Pulse }[];
  void actuator?.pulse?.(strength, ms);
}

type Pulse = (strength: number, ms: number) => Promise<boolean>;
