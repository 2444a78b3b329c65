// Bodies of one shape and colour drawn in one call, as thousands of screws of a line; each is picked by itself.
// Without a graphics card those that are out of sight are left out, and far ones have fewer corners.

import {
  type BufferGeometry,
  type Frustum,
  Group,
  InstancedMesh,
  type Material,
  Matrix4,
  type Mesh,
  MeshDepthMaterial,
  Sphere,
  type Vector3,
} from "three";
import { drawnBySoftware } from "./effort";
import { Levels, triangles } from "./levels";
import { ownMaterial } from "./materials";

/** Fewer of one shape are drawn one by one, unless they have many triangles. */
const LEAST = 4;
const MANY_TRIANGLES = 200;
/** What moved not longer ago may move on [ms]. */
const STILL_MS = 250;
/** Layer of what no camera sees, and rays meet all the same. Masks of higher ones are no small integers to V8. */
export const ALONE_LAYER = 28;
/** Of shadows: with one for single bodies and crowds three.js looks its programs up anew at each change, in every picture. */
const manyDepth = new MeshDepthMaterial();

/** A mesh of a body that may be drawn with others. */
export interface Dressed {
  mesh: Mesh;
  /** As it came, equal for bodies of one shape. */
  given: Material | Material[];
  /** Where it is in its body's frame. */
  local: Matrix4;
}

/** A body, as far as it matters here. */
interface Clad {
  readonly group: Group;
  readonly meshes: readonly Dressed[];
  /** Whether it is seen as it came. */
  readonly plain: boolean;
  /** Told when it looks different or is elsewhere. */
  readonly followers: (() => void)[];
}

interface Member {
  body: Clad;
  dressed: Dressed;
  /** Where it is, and the ball around it there. */
  place: Matrix4;
  ball: Sphere;
  within: boolean;
}

/** From where one looks, in the frame of the bodies. */
export interface Sight {
  eye: Vector3;
  frustum: Frustum;
  /** Size of a pixel of the screen one metre away [m]. */
  pixel: number;
}

interface Level {
  drawn: InstancedMesh;
  /** How far its shape may be from the true one [m]. */
  off: number;
}

export class Crowd {
  /** All of it, to be drawn. */
  readonly root = new Group();
  /** From the true shape to the coarsest one that there is. */
  readonly levels: Level[] = [];
  private readonly shapes: Levels;
  private readonly material: Material;
  private changed = true;
  /** When one of it was seen last to have moved or to look different [ms]. */
  private changedAt = 0;
  /** How far off the one that is seen smallest may be [m]. */
  private coarsest = 0;
  private readonly members: readonly Member[];

  /** Meshes that are drawn in one call; `members` has at least one. */
  constructor(members: readonly Pick<Member, "body" | "dressed">[]) {
    const { mesh, given } = members[0]!.dressed;
    this.material = ownMaterial(given as Material);
    this.shapes = Levels.of(mesh.geometry);
    this.members = members.map((member) => ({
      ...member,
      place: new Matrix4(),
      ball: new Sphere(),
      within: true,
    }));
    for (const member of this.members) {
      member.body.followers.push(() => this.follow(member));
      this.follow(member);
    }
    this.arrange(null, true);
  }

  // One that looks different, or is hidden, is drawn by itself or not at all.
  private follow(member: Member): void {
    const { body, dressed, place, ball } = member;
    member.within = body.plain && body.group.visible;
    dressed.mesh.layers.set(member.within ? ALONE_LAYER : 0);
    place.multiplyMatrices(body.group.matrix, dressed.local);
    ball.copy(dressed.mesh.geometry.boundingSphere!).applyMatrix4(place);
    this.changed = true;
  }

  /**
   * Draw each where it is, no finer than one sees.
   *
   * @param sight From where one looks; null where all are drawn as they are.
   * @param anew Whether that is another place than before.
   * @param kept Whether it stands, and a picture of it is kept: a coarser shape waits for the next place.
   * @returns Whether it may look different than before.
   */
  arrange(sight: Sight | null, anew: boolean, kept = false): boolean {
    const { levels, shapes } = this;
    if (!anew && !this.changed && (kept || levels.length === shapes.made.length)) return false;
    this.changed = false;
    this.coarsest = 0;
    while (levels.length < shapes.made.length) this.take(shapes.made[levels.length]!);
    for (const { drawn } of levels) drawn.count = 0;
    for (const { within, place, ball } of this.members) {
      if (!within || (sight && !sight.frustum.intersectsSphere(ball))) continue;
      const { drawn } = levels[sight ? this.levelOf(sight, ball) : 0]!;
      drawn.setMatrixAt(drawn.count, place);
      drawn.count += 1;
    }
    for (const { drawn } of levels) {
      drawn.visible = drawn.count > 0;
      drawn.instanceMatrix.needsUpdate = drawn.visible;
    }
    return true;
  }

  /** Whether it stands still at a time [ms], and has for a while; asked before it is arranged. */
  stands(time: number): boolean {
    if (this.changed) this.changedAt = time;
    return time - this.changedAt > STILL_MS;
  }

  /** Triangles that are drawn of it now. */
  get triangles(): number {
    let sum = 0;
    for (const { drawn } of this.levels) sum += drawn.count * triangles(drawn.geometry);
    return sum;
  }

  private take({ shape, off }: { shape: BufferGeometry; off: number }): void {
    const drawn = new InstancedMesh(shape, this.material, this.members.length);
    drawn.castShadow = drawn.receiveShadow = true;
    if (this.material.alphaTest === 0) drawn.customDepthMaterial = manyDepth;
    drawn.frustumCulled = false;
    drawn.raycast = () => {};
    this.root.add(drawn);
    this.levels.push({ drawn, off });
  }

  /** Work on a coarser shape, where one would do, until a time [ms]; the finer one is drawn until it is there. */
  refine(until: number): void {
    if (this.coarsest >= this.shapes.next) this.shapes.work(until);
  }

  // The coarsest of which no point is a pixel off.
  private levelOf({ eye, pixel }: Sight, { center, radius }: Sphere): number {
    const seen = pixel * Math.max(eye.distanceTo(center) - radius, 0);
    this.coarsest = Math.max(this.coarsest, seen);
    let level = this.levels.length - 1;
    while (level > 0 && this.levels[level]!.off > seen) level -= 1;
    return level;
  }

  dispose(): void {
    for (const { drawn } of this.levels) drawn.dispose();
  }
}

/** Crowds among bodies. */
export function crowdsOf(bodies: readonly Clad[]): Crowd[] {
  const alike = new Map<string, Pick<Member, "body" | "dressed">[]>();
  for (const body of bodies) {
    for (const dressed of body.meshes) {
      const { mesh, given } = dressed;
      if (Array.isArray(given) || given.transparent) continue;
      const key = `${mesh.geometry.uuid} ${given.uuid}`;
      const members = alike.get(key);
      if (members) members.push({ body, dressed });
      else alike.set(key, [{ body, dressed }]);
    }
  }
  const heavy = ({ dressed }: Pick<Member, "dressed">): boolean =>
    drawnBySoftware() && triangles(dressed.mesh.geometry) >= MANY_TRIANGLES;
  return [...alike.values()]
    .filter((members) => members.length >= LEAST || heavy(members[0]!))
    .map((members) => new Crowd(members));
}
