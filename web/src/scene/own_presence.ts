// Where this visitor is, as the others are told: head, hands and laser in the world (z up), when they have moved.

import { Matrix4, Quaternion, Vector3 } from "three";
import { ownPlace } from "../company";
import type { ToWorker } from "../messages";
import type { Presence } from "../wire";
import type { Stage } from "./stage";

const EVERY_MS = 1000 / 30;
/** What moves less is no news: share of a metre of the visitor. */
const LEAST = 1e-4;
const FLOATS = 7;
const NOTHING = new Uint8Array();

/** What a visit in the room knows of its visitor, in the space of the rig; false for what is not there. */
export interface Sighted {
  head(position: Vector3, turn: Quaternion): boolean;
  hand(side: "left" | "right", position: Vector3, turn: Quaternion): boolean;
  /** Joints that the headset sees: three numbers each. */
  joints(into: Float32Array): number;
  laser(from: Vector3, to: Vector3): boolean;
}

export class OwnPresence {
  // Made once: a picture allocates nothing of ours.
  private readonly poses = new Float32Array(3 * FLOATS);
  private readonly said = new Float32Array(3 * FLOATS).fill(Number.NaN);
  private readonly points = new Float32Array(3 * 160);
  private readonly beam = new Float32Array(6);
  private readonly position = new Vector3();
  private readonly to = new Vector3();
  private readonly turn = new Quaternion();
  private readonly rigTurn = new Quaternion();
  private readonly fromRig = new Matrix4();
  private readonly upright = new Quaternion();
  private readonly beamBytes = new Uint8Array(this.beam.buffer);
  private readonly presence: Presence = {
    type: "presence",
    poses: new Uint8Array(this.poses.buffer),
    points: NOTHING,
    laser: NOTHING,
  };
  private readonly message: ToWorker = { kind: "company", said: this.presence };
  private at = Number.NEGATIVE_INFINITY;
  private pointed = false;

  constructor(
    private readonly stage: Stage,
    private readonly send: (message: ToWorker) => void,
  ) {}

  /** Once per picture; `visit` is null on the desk. */
  tick(time: number, visit: Sighted | null): void {
    if (time - this.at < EVERY_MS) return;
    const { stage, poses } = this;
    stage.rig.updateMatrixWorld();
    stage.world.updateMatrixWorld();
    this.fromRig.copy(stage.world.matrixWorld).invert().multiply(stage.rig.matrixWorld);
    this.upright.setFromRotationMatrix(stage.world.matrixWorld).invert();
    this.rigTurn.copy(stage.rig.quaternion).premultiply(this.upright);
    poses.fill(Number.NaN);
    const { camera } = stage;
    if (!visit) this.put(0, this.position.copy(camera.position), this.turn.copy(camera.quaternion));
    else {
      if (visit.head(this.position, this.turn)) this.put(0, this.position, this.turn);
      if (visit.hand("left", this.position, this.turn)) this.put(1, this.position, this.turn);
      if (visit.hand("right", this.position, this.turn)) this.put(2, this.position, this.turn);
    }
    const points = visit?.joints(this.points) ?? 0;
    const points_at = visit?.laser(this.position, this.to) ?? false;
    if (!this.moved() && !(points_at || this.pointed)) return;
    this.at = time;
    this.pointed = points_at;
    this.said.set(poses);
    for (let i = 0; i < points; i += 1)
      this.position
        .fromArray(this.points, 3 * i)
        .applyMatrix4(this.fromRig)
        .toArray(this.points, 3 * i);
    if (points_at) {
      visit!.laser(this.position, this.to);
      this.position.applyMatrix4(this.fromRig).toArray(this.beam, 0);
      this.to.applyMatrix4(this.fromRig).toArray(this.beam, 3);
    }
    this.place();
    // The worker gets copies, by message.
    const { presence } = this;
    if (presence.points!.byteLength !== 12 * points)
      presence.points = new Uint8Array(this.points.buffer, 0, 12 * points);
    presence.laser = points_at ? this.beamBytes : NOTHING;
    this.send(this.message);
  }

  private put(row: number, position: Vector3, turn: Quaternion): void {
    position.applyMatrix4(this.fromRig);
    turn.premultiply(this.rigTurn).normalize();
    const at = row * FLOATS;
    // By hand: three.js's function for it is used with all kinds of lists, and each number is an object there.
    this.poses[at] = position.x;
    this.poses[at + 1] = position.y;
    this.poses[at + 2] = position.z;
    this.poses[at + 3] = turn.w;
    this.poses[at + 4] = turn.x;
    this.poses[at + 5] = turn.y;
    this.poses[at + 6] = turn.z;
  }

  private moved(): boolean {
    const least = LEAST * this.stage.rig.scale.x;
    for (let i = 0; i < this.poses.length; i += 1) {
      const now = this.poses[i]!;
      const before = this.said[i]!;
      if (Number.isNaN(now) !== Number.isNaN(before) || Math.abs(now - before) > least) return true;
    }
    return false;
  }

  /** Where the floor of the visitor's room lies; told when it is another. */
  private place(): void {
    const { rig } = this.stage;
    this.position.setFromMatrixPosition(this.fromRig);
    const { x, y, z, w } = this.rigTurn;
    const known = ownPlace.peek();
    const at = known.position!;
    const turn = known.turn!;
    const far = Math.hypot(this.position.x - at[0], this.position.y - at[1], this.position.z - at[2]);
    const turned = 1 - Math.abs(w * turn[0] + x * turn[1] + y * turn[2] + z * turn[3]);
    if (far > LEAST * rig.scale.x || turned > 1e-9)
      ownPlace.value = { position: [this.position.x, this.position.y, this.position.z], turn: [w, x, y, z] };
  }
}
