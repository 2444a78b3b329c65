// Design in place: a hand takes what the workstation file has, moves or turns it and lets it go, as the handles on
// the desk do; or it carries a robot's tool to where a waypoint is to be.

import { Group, MathUtils, Matrix4, Mesh, Quaternion, Vector3 } from "three";
import { holding } from "../company";
import { change, type Entry, entries, isPlaced, refused } from "../editing/draft";
import { gizmoMode, STEPS, steps } from "../editing/handles";
import { scene, select } from "../page_state";
import { Carried, placeIn, whereIs } from "../scene/carried";
import { markMaterial } from "../scene/materials";
import type { Viewer } from "../scene/viewer";
import type { Place, Taught } from "../wire";

/** A hand is at a body that is no farther than this from its middle, by the box of the body [m]. */
const AROUND = 0.08;
const ONE = new Vector3(1, 1, 1);
const AXES = [new Vector3(1, 0, 0), new Vector3(0, 1, 0), new Vector3(0, 0, 1)] as const;

type Hand = "left" | "right";

interface Held {
  /** Of the hand when it took, in the world (z up). */
  readonly position: Vector3;
  readonly turn: Quaternion;
  /** What it turns about, there [m]. */
  readonly origin: Vector3;
  /** What it moves; of a waypoint null. */
  readonly carried: Carried | null;
  readonly lesson: Lesson | null;
  /** Whether it was let go, and the server has not answered yet. */
  asked: boolean;
}

/** A tool on its way to where a waypoint is to be. */
interface Lesson {
  readonly of: Taught;
  readonly tip: Matrix4;
  readonly ghost: Group;
  readonly motion: Matrix4;
}

export class Designing {
  on = false;
  teaches = false;
  private readonly held = new Map<Hand, Held>();
  // Made once: a picture allocates nothing of ours.
  private readonly inverse = new Matrix4();
  private readonly position = new Vector3();
  private readonly turn = new Quaternion();
  private readonly scale = new Vector3();
  private readonly back = new Matrix4();
  private readonly by = new Vector3();
  private readonly turned = new Quaternion();

  constructor(private readonly viewer: Viewer) {}

  /** Whether a hand has something, or waits for what became of it. */
  holds(side: Hand): boolean {
    return this.held.has(side);
  }

  /**
   * A hand closes.
   *
   * @param pointed Node that its beam meets; null for none.
   * @param hand Where it is, in three.js's world.
   * @returns Whether it has something then.
   */
  close(side: Hand, pointed: string | null, hand: Matrix4): boolean {
    if (!this.on) return false;
    if (this.held.has(side)) return true;
    this.look(hand);
    // Beams go through areas; whoever is in a large one takes everything else first.
    const name = this.around(hand, false) ?? pointed ?? this.around(hand, true);
    const node = scene.peek()?.nodes.find((each) => each.name === name);
    if (!node) return false;
    select({ kind: "node", name: node.name });
    let carried: Carried | null = null;
    let lesson: Lesson | null = null;
    if (this.teaches) lesson = this.lesson(node.mover || node.owner);
    else {
      const entry = entries.peek().find((each) => each.name === node.owner && isPlaced(each.group));
      carried = entry ? this.carried(entry) : null;
    }
    if (!carried && !lesson) return false;
    this.held.set(side, {
      position: this.position.clone(),
      turn: this.turn.clone(),
      origin: carried ? carried.origin(new Vector3()) : new Vector3(),
      carried,
      lesson,
      asked: false,
    });
    this.tell();
    return true;
  }

  /** Where a hand that has something is at this picture; also of one that waits for what became of it. */
  move(side: Hand, hand: Matrix4): void {
    const held = this.held.get(side);
    if (!held) return;
    if (!held.asked) {
      this.look(hand);
      if (held.lesson) this.rigidly(held, held.lesson.motion);
      else if (gizmoMode.peek() === "move") this.shift(held, held.carried!.motion);
      else this.about(held, held.carried!.motion);
    }
    if (held.lesson) held.lesson.ghost.matrixWorldNeedsUpdate = true;
    // The frames of a run that goes on have it where it was.
    held.carried?.show();
  }

  /** A hand opens: the file is to have it there. */
  open(side: Hand): void {
    const held = this.held.get(side);
    if (!held || held.asked) return;
    held.asked = true;
    const { carried, lesson } = held;
    const done = lesson ? this.teach(lesson) : carried!.put(gizmoMode.peek() === "turn");
    void done.then(() => this.forget(side, held));
  }

  /** Let go of everything; what is on its way to the file goes on. */
  end(): void {
    for (const [side, held] of this.held) this.forget(side, held);
  }

  private forget(side: Hand, held: Held): void {
    if (held.lesson) this.viewer.stage.world.remove(held.lesson.ghost);
    if (this.held.get(side) === held) this.held.delete(side);
    this.tell();
    this.viewer.stage.moved();
  }

  private tell(): void {
    holding.value = [...this.held.values()].flatMap(({ carried }) => (carried ? [carried.entry.name] : []));
  }

  private carried(entry: Entry): Carried | null {
    const { stage, bodies } = this.viewer;
    return Carried.of(entry, bodies, () => stage.moved());
  }

  /** Where a hand is, in the world (z up), into `position` and `turn`. */
  private look(hand: Matrix4): void {
    this.inverse.copy(this.viewer.stage.world.matrixWorld).invert();
    this.inverse.multiply(hand).decompose(this.position, this.turn, this.scale);
  }

  // In steps, as the handles go.
  private shift({ position }: Held, into: Matrix4): void {
    const by = this.by.copy(this.position).sub(position);
    const [step] = STEPS[steps.peek()];
    if (step) by.divideScalar(step).round().multiplyScalar(step);
    into.makeTranslation(by);
  }

  // About the axis of the cell that the hand turned about most, as one ring of the handles does.
  private about({ turn, origin }: Held, into: Matrix4): void {
    const { x, y, z, w } = this.turn.multiply(this.turned.copy(turn).conjugate());
    const half = Math.acos(Math.min(1, Math.abs(w)));
    const long = (2 * half * Math.sign(w || 1)) / (Math.sin(half) || 1);
    const most = Math.max(Math.abs(x), Math.abs(y), Math.abs(z));
    const k = Math.abs(x) === most ? 0 : Math.abs(y) === most ? 1 : 2;
    const angle = long * (k === 0 ? x : k === 1 ? y : z);
    const step = MathUtils.degToRad(STEPS[steps.peek()][1]);
    into
      .makeTranslation(origin)
      .multiply(this.back.makeRotationAxis(AXES[k]!, step ? step * Math.round(angle / step) : angle))
      .multiply(this.back.makeTranslation(-origin.x, -origin.y, -origin.z));
  }

  private rigidly({ position, turn }: Held, into: Matrix4): void {
    this.back.compose(position, turn, ONE).invert();
    into.compose(this.position, this.turn, ONE).multiply(this.back);
  }

  /** The smallest body in whose box a hand is, of areas or of all others; null for none. */
  private around(hand: Matrix4, areas: boolean): string | null {
    let [found, least] = [null as string | null, Number.POSITIVE_INFINITY];
    const size = new Vector3();
    const at = new Vector3();
    for (const { node, group, extent } of this.viewer.bodies.byName.values()) {
      if (!group.visible || extent.isEmpty() || (node.role === "area") !== areas) continue;
      group.worldToLocal(at.setFromMatrixPosition(hand));
      if (extent.distanceToPoint(at) > AROUND) continue;
      const volume = extent.getSize(size).x * size.y * size.z;
      if (volume < least) [found, least] = [node.name, volume];
    }
    return found;
  }

  // -- waypoints ----------------------------------------------------------------------------------

  private lesson(robot: string): Lesson | null {
    const of = scene.peek()?.taught.find((each) => each.robot === robot && each.source !== null);
    const tip = of && this.poseOf(of.tip);
    if (!of || !tip) {
      const what = `no source of kind waypoints has points of ${robot || "this"} to which one could be added`;
      const remedy = "give the robot one with its speeds: docs/sources/waypoints.md";
      refused.value = { changes: [], mistakes: [{ key: "sources", what, remedy }] };
      return null;
    }
    const ghost = new Group();
    for (const { node, group } of this.viewer.bodies.byName.values()) {
      if (node.name !== of.tip.node && !(node.role === "tool" && node.mover === robot)) continue;
      group.traverse((part) => {
        if (!(part instanceof Mesh)) return;
        const copy = new Mesh(part.geometry, markMaterial("ghost"));
        copy.matrixAutoUpdate = false;
        this.inverse.copy(this.viewer.stage.world.matrixWorld).invert();
        copy.matrix.multiplyMatrices(this.inverse, part.matrixWorld);
        ghost.add(copy);
      });
    }
    ghost.matrixAutoUpdate = false;
    this.viewer.stage.world.add(ghost);
    return { of, tip, ghost, motion: ghost.matrix };
  }

  // Whether the robot gets there the server says: it solves the pose as every run of the file does.
  private teach({ of, tip, motion }: Lesson): Promise<boolean> {
    const at = placeIn(of.base, this.viewer.bodies, motion.clone().multiply(tip));
    if (!at || of.source === null) return Promise.resolve(false);
    const value = { name: `taught_${of.points + 1}`, move: "joint", at };
    return change({ kind: "add", path: ["sources", of.source, "points"], value });
  }

  /** Where a place is, in the world (z up); null where its node is not there. */
  private poseOf(place: Place): Matrix4 | null {
    const found = new Matrix4();
    return whereIs(place, this.viewer.bodies, found) ? found : null;
  }
}
