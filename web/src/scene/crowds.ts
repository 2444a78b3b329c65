// Bodies of one shape and colour drawn in one call, as thousands of screws of a line; each is picked by itself.
// Without a graphics card those that are out of sight are left out, and far ones have fewer corners.

import {
  type BufferGeometry,
  type Frustum,
  type Group,
  InstancedMesh,
  type Material,
  Matrix4,
  type Mesh,
  Sphere,
  type Vector3,
} from "three";
import { type Coarser, coarser } from "./coarser";
import { drawnBySoftware } from "./effort";
import { ownMaterial } from "./materials";

/** Fewer of one shape are drawn one by one, unless they have many triangles. */
const LEAST = 4;
const MANY_TRIANGLES = 200;
/** Layer of what no camera sees, and rays meet all the same. Masks of higher ones are no small integers to V8. */
export const ALONE_LAYER = 28;
/** Cells of coarser shapes, as shares of the radius of the whole. */
const CELLS = [0.06, 0.1, 0.16, 0.25, 0.5];
/** A coarser shape that has not so much fewer corners is none. */
const WORTH = 0.7;

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
  /** From the true shape to the coarsest one. */
  readonly levels: Level[];
  private changed = true;
  private readonly members: readonly Member[];

  /** Meshes that are drawn in one call; `members` has at least one. */
  constructor(members: readonly Pick<Member, "body" | "dressed">[]) {
    const { mesh, given } = members[0]!.dressed;
    const material = ownMaterial(given as Material);
    this.levels = shapesOf(mesh.geometry).map(({ shape, off }) => {
      const drawn = new InstancedMesh(shape, material, members.length);
      drawn.castShadow = drawn.receiveShadow = true;
      drawn.frustumCulled = false;
      drawn.raycast = () => {};
      return { drawn, off };
    });
    this.members = members.map((member) => ({
      ...member,
      place: new Matrix4(),
      ball: new Sphere(),
      within: true,
    }));
    if (!mesh.geometry.boundingSphere) mesh.geometry.computeBoundingSphere();
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
   */
  arrange(sight: Sight | null, anew: boolean): void {
    if (!anew && !this.changed) return;
    this.changed = false;
    for (const { drawn } of this.levels) drawn.count = 0;
    for (const { within, place, ball } of this.members) {
      if (!within || (sight && !sight.frustum.intersectsSphere(ball))) continue;
      const { drawn } = this.levels[sight ? this.levelOf(sight, ball) : 0]!;
      drawn.setMatrixAt(drawn.count, place);
      drawn.count += 1;
    }
    for (const { drawn } of this.levels) {
      drawn.visible = drawn.count > 0;
      drawn.instanceMatrix.needsUpdate = drawn.visible;
    }
  }

  // The coarsest of which no point is a pixel off.
  private levelOf({ eye, pixel }: Sight, { center, radius }: Sphere): number {
    const seen = pixel * Math.max(eye.distanceTo(center) - radius, 0);
    let level = this.levels.length - 1;
    while (level > 0 && this.levels[level]!.off > seen) level -= 1;
    return level;
  }

  dispose(): void {
    for (const { drawn } of this.levels) drawn.dispose();
  }
}

const shapes = new WeakMap<BufferGeometry, Coarser[]>();

/** A shape and coarser ones of it, with how far these are off [m]; of all crowds that have it. */
function shapesOf(shape: BufferGeometry): Coarser[] {
  let known = shapes.get(shape);
  if (!known) {
    known = [{ shape, off: 0 }];
    const plain = Object.keys(shape.attributes).every((name) => name === "position" || name === "normal");
    if (drawnBySoftware() && plain && shape.hasAttribute("normal")) {
      if (!shape.boundingSphere) shape.computeBoundingSphere();
      for (const share of CELLS) {
        const made = coarser(shape, share * shape.boundingSphere!.radius);
        if (cost(made.shape) <= WORTH * cost(known.at(-1)!.shape)) known.push(made);
      }
    }
    shapes.set(shape, known);
  }
  return known;
}

/** Corners that are looked up and those that are worked out. */
const cost = (shape: BufferGeometry): number =>
  triangles(shape) + (shape.index ? shape.getAttribute("position").count : 3 * triangles(shape));

const triangles = (shape: BufferGeometry): number =>
  (shape.index?.count ?? shape.getAttribute("position").count) / 3;

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
