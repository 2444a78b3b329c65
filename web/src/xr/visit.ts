// A visit in the room: a WebXR session in which the twin stands around the visitor, who looks at it or is a
// person of it. One model, two views: what the panels of the page show, the room shows.

import { effect } from "@preact/signals";
import {
  BufferGeometry,
  Group,
  Line,
  LineBasicMaterial,
  Matrix4,
  Mesh,
  MeshBasicMaterial,
  Quaternion,
  Raycaster,
  RingGeometry,
  SphereGeometry,
  Vector3,
} from "three";
import { ownScale } from "../company";
import { hidden, overReality, rows, scene } from "../page_state";
import type { Sighted } from "../scene/own_presence";
import type { Viewer } from "../scene/viewer";
import type { Tracking } from "../wire";
import { Board } from "./board";
import { bodyJoints, sight } from "./sight";

export type Mode = "immersive-vr" | "immersive-ar";

const MODES: readonly Mode[] = ["immersive-vr", "immersive-ar"];
const WANTED: XRSessionInit = {
  requiredFeatures: ["local-floor"],
  optionalFeatures: ["hand-tracking", "body-tracking"],
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
const BESIDE_WRIST = new Vector3(0, 0.16, -0.05);
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
  readonly ball = new Mesh(new SphereGeometry(0.022, 16, 10), new MeshBasicMaterial({ color: 0xdbe3ee }));
  readonly beam = new Line(
    new BufferGeometry().setFromPoints([new Vector3(), new Vector3(0, 0, -1)]),
    new LineBasicMaterial({ color: 0x7ee7f1 }),
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
    new MeshBasicMaterial({ color: 0x7ee7f1 }),
  );
  private readonly board = new Board();
  private readonly ray = new Raycaster();
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
    private readonly send: (tracking: Tracking) => void,
  ) {
    const { stage } = viewer;
    this.rig = stage.rig;
    this.before = this.remember();
    this.things.add(this.board.mesh, this.landing);
    for (const { ball, beam } of Object.values(this.pointers)) this.things.add(ball, beam);
    this.landing.visible = false;
    this.rig.add(this.things);
    this.stand();
    session.addEventListener("select", this.select);
    const forgets = [effect(() => this.feel()), effect(() => this.resize(ownScale.value))];
    this.forget = () => {
      for (const forget of forgets) forget();
    };
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
    send: (tracking: Tracking) => void,
  ): Promise<Visit> {
    if (!navigator.xr) throw new Error("this browser has no headset");
    const session = await navigator.xr.requestSession(mode, WANTED);
    const { xr } = viewer.stage.renderer;
    const visit = new Visit(session, mode, human, viewer, send);
    xr.enabled = true;
    xr.setReferenceSpaceType("local-floor");
    await xr.setSession(session);
    // After three.js has heard it: until then the camera is the headset's.
    session.addEventListener("end", () => visit.end());
    return visit;
  }

  /** Once per picture of the session, before it is drawn. */
  tick(time: number, frame: XRFrame | undefined): void {
    const space = this.viewer.stage.renderer.xr.getReferenceSpace();
    if (!frame || !space) return;
    if (this.human !== null) {
      const seen = sight(frame, space, this.session.inputSources, this.human, time);
      if (seen) {
        seen.scale = this.rig.scale.x;
        this.send(seen);
      }
    }
    const viewer = frame.getViewerPose(space);
    if (viewer) {
      const { position: p, orientation: q } = viewer.transform;
      this.eyes.set(p.x, p.y, p.z);
      this.facing.set(q.x, q.y, q.z, q.w);
    }
    this.frame = frame;
    this.rig.updateMatrixWorld();
    for (const pointer of Object.values(this.pointers)) pointer.ball.visible = pointer.beam.visible = false;
    this.landing.visible = false;
    for (const source of this.session.inputSources) this.hold(frame, space, source);
    if (!this.pointers.left.ball.visible) this.board.mesh.position.copy(FACING);
    this.board.mesh.lookAt(this.rig.localToWorld(this.at.copy(this.eyes)));
    this.board.update(time);
    this.viewer.stage.invalidate();
  }

  /** Where the floor of the visitor's room lies in the world (y up), and how large the visitor is. */
  stand(): void {
    const { rig, viewer, human } = this;
    const placed = human === null ? null : scene.peek()?.headsets[human];
    if (placed) {
      const [x, y, z, qw, qx, qy, qz] = placed;
      this.turn.set(qx, qy, qz, qw);
      rig.matrix.compose(this.at.set(x, y, z), this.turn, new Vector3(1, 1, 1));
      viewer.stage.world.updateMatrix();
      rig.matrix.premultiply(viewer.stage.world.matrix).multiply(AHEAD);
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
    for (const { beam } of [this.pointers.right, this.pointers.left]) {
      if (!beam.visible) continue;
      from.copy(beam.position);
      to.set(0, 0, -beam.scale.x).applyQuaternion(beam.quaternion).add(beam.position);
      return true;
    }
    return false;
  }

  /** Where a point of the visitor's room [m] is in the world (y up). */
  inWorld(point: [number, number, number]): [number, number, number] {
    this.rig.updateMatrixWorld();
    return this.rig.localToWorld(new Vector3(...point)).toArray();
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
      if (source.handedness === "left") this.board.mesh.position.set(x, y, z).add(BESIDE_WRIST);
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
    // Who is a person of the twin goes on their own feet.
    if (this.human === null) this.steer(pointer, source.gamepad);
  }

  /** Turn at a push to the side, go where one points at a push ahead that is let go. */
  private steer(pointer: Pointer, gamepad: Gamepad | undefined): void {
    const x = gamepad?.axes[2] ?? 0;
    const y = gamepad?.axes[3] ?? 0;
    if (Math.abs(x) > PUSHED && !pointer.turned) this.turnBy(-Math.sign(x) * SNAP);
    pointer.turned = Math.abs(x) > (pointer.turned ? RELEASED : PUSHED);
    const floor = this.floor(pointer);
    const pushed = y < -(pointer.walking ? RELEASED : PUSHED);
    if (pushed && floor) {
      pointer.beam.visible = true;
      pointer.beam.scale.setScalar(floor.distanceTo(pointer.from) / this.rig.scale.x);
      this.landing.visible = true;
      this.landing.position.copy(this.rig.worldToLocal(this.at.copy(floor))).y += 0.005;
    }
    if (pointer.walking && !pushed && floor) this.go(floor);
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

  private readonly select = (event: XRInputSourceEvent): void => {
    const side = event.inputSource.handedness;
    if (side !== "left" && side !== "right") return;
    const { from, along } = this.pointers[side];
    this.ray.set(from, along);
    this.viewer.pick(this.ray);
  };

  /** A pulse in both hands as soon as a limit is exceeded. */
  private feel(): void {
    const now = new Set(rows.value.filter(({ state }) => state === "exceeded").map(({ info }) => info.name));
    const more = [...now].some((name) => !this.exceeded.has(name));
    this.exceeded = now;
    if (!more) return;
    for (const { gamepad } of this.session.inputSources) {
      const [actuator] = (gamepad?.hapticActuators ?? []) as unknown as { pulse?: Pulse }[];
      void actuator?.pulse?.(PULSE.strength, PULSE.ms);
    }
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
    rig.remove(things);
    rig.position.set(0, 0, 0);
    rig.quaternion.identity();
    rig.scale.setScalar(1);
    this.board.dispose();
    for (const { ball, beam } of Object.values(this.pointers))
      for (const each of [ball, beam]) each.geometry.dispose();
    this.before();
    viewer.stage.renderer.xr.enabled = false;
    viewer.stage.resize();
  }
}

type Pulse = (strength: number, ms: number) => Promise<boolean>;
