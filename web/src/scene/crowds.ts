// Bodies of one shape and colour drawn in one call, as thousands of screws of a line; each is picked by itself.

import { type Group, InstancedMesh, type Material, Matrix4, type Mesh } from "three";
import { ownMaterial } from "./materials";

/** Fewer of one shape are drawn one by one. */
const LEAST = 4;
/** Layer of what no camera sees, and rays meet all the same. Masks of higher ones are no small integers to V8. */
export const ALONE_LAYER = 28;
const NOWHERE = new Matrix4().makeScale(0, 0, 0);

/** A mesh of a body that may be drawn with others. */
export interface Dressed {
  mesh: Mesh;
  own: Material | Material[];
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
}

export class Crowd {
  readonly drawn: InstancedMesh;
  private readonly place = new Matrix4();

  /** Meshes that are drawn in one call; `members` has at least one. */
  constructor(private readonly members: readonly Member[]) {
    const { mesh, given } = members[0]!.dressed;
    this.drawn = new InstancedMesh(mesh.geometry, ownMaterial(given as Material), members.length);
    this.drawn.castShadow = this.drawn.receiveShadow = true;
    this.drawn.frustumCulled = false;
    this.drawn.raycast = () => {};
    for (const [k, { body }] of members.entries()) {
      body.followers.push(() => this.follow(k));
      this.follow(k);
    }
  }

  // One that looks different, or is hidden, is drawn by itself or not at all.
  private follow(k: number): void {
    const { body, dressed } = this.members[k]!;
    const within = body.plain && body.group.visible;
    dressed.mesh.layers.set(within ? ALONE_LAYER : 0);
    this.drawn.setMatrixAt(
      k,
      within ? this.place.multiplyMatrices(body.group.matrix, dressed.local) : NOWHERE,
    );
    this.drawn.instanceMatrix.needsUpdate = true;
  }
}

/** Crowds among bodies. */
export function crowdsOf(bodies: readonly Clad[]): Crowd[] {
  const alike = new Map<string, Member[]>();
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
  return [...alike.values()].filter(({ length }) => length >= LEAST).map((members) => new Crowd(members));
}
