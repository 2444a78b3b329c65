// What is drawn in a picture, in its order: in place of three.js's own list, which gives its memory back before each
// picture and takes it anew. Order and what is drawn are the same.

import type { BufferGeometry, Group, Material, Object3D, Scene, WebGLRenderer } from "three";

/** What is drawn in one call, as three.js's renderer reads it. How deep has a fraction, so that it has room for one. */
class Item {
  id = 0;
  object: Object3D | null = null;
  geometry: BufferGeometry | null = null;
  material: Material | null = null;
  materialVariant = 0;
  groupOrder = 0;
  renderOrder = 0;
  z = 0.5;
  group: Group | null = null;
}

/** Kinds of an object, as three.js notes them. */
type Kind = { isInstancedMesh?: boolean; isSkinnedMesh?: boolean };

/** Shorter stretches are sorted by putting each where it belongs, and longer ones put together of them. */
const STRETCH = 8;
const aside: Item[] = [];

export class RenderList {
  readonly opaque: Item[] = [];
  readonly transmissive: Item[] = [];
  readonly transparent: Item[] = [];
  /** How deep the next one lies, in clip space: as a number that is handed over it would be an object each time. */
  readonly depth = new Float64Array(1);
  private readonly items: Item[] = [];
  private used = 0;
  private opaqueCount = 0;
  private transmissiveCount = 0;
  private transparentCount = 0;

  /** Begin a picture. Lists keep their length until `finish`: what is emptied gives its memory back. */
  init(): void {
    this.used = this.opaqueCount = this.transmissiveCount = this.transparentCount = 0;
  }

  /** Add what is drawn; how deep it lies is in `depth`. The depth buffer is never reversed here. */
  push(
    object: Object3D,
    geometry: BufferGeometry,
    material: Material,
    groupOrder: number,
    _z: number,
    group: Group | null,
  ): void {
    const item = this.next(object, geometry, material, groupOrder, group);
    if (((material as { transmission?: number }).transmission ?? 0) > 0) {
      this.transmissive[this.transmissiveCount] = item;
      this.transmissiveCount += 1;
    } else if (material.transparent) {
      this.transparent[this.transparentCount] = item;
      this.transparentCount += 1;
    } else {
      this.opaque[this.opaqueCount] = item;
      this.opaqueCount += 1;
    }
  }

  /** Add what is drawn before all others; after `finish`. */
  unshift(
    object: Object3D,
    geometry: BufferGeometry,
    material: Material,
    groupOrder: number,
    z: number,
    group: Group | null,
  ): void {
    this.depth[0] = z;
    const item = this.next(object, geometry, material, groupOrder, group);
    if (((material as { transmission?: number }).transmission ?? 0) > 0) this.transmissive.unshift(item);
    else (material.transparent ? this.transparent : this.opaque).unshift(item);
  }

  /** All is there: forget what was drawn before and is not any more. */
  finish(): void {
    this.opaque.length = this.opaqueCount;
    this.transmissive.length = this.transmissiveCount;
    this.transparent.length = this.transparentCount;
    for (let k = this.used; k < this.items.length; k += 1) {
      const item = this.items[k]!;
      if (item.object === null) break;
      item.object = item.geometry = item.material = item.group = null;
    }
  }

  /** Near ones first where they hide what is behind, far ones first where it is seen through them. */
  sort(): void {
    sort(this.opaque, false);
    sort(this.transmissive, true);
    sort(this.transparent, true);
  }

  private next(
    object: Object3D,
    geometry: BufferGeometry,
    material: Material,
    groupOrder: number,
    group: Group | null,
  ): Item {
    let item = this.items[this.used];
    if (!item) {
      item = new Item();
      this.items[this.used] = item;
    }
    this.used += 1;
    const { isInstancedMesh, isSkinnedMesh } = object as Kind;
    item.id = object.id;
    item.object = object;
    item.geometry = geometry;
    item.material = material;
    item.materialVariant = (isInstancedMesh ? 2 : 0) + (isSkinnedMesh ? 1 : 0);
    item.groupOrder = groupOrder;
    item.renderOrder = object.renderOrder;
    item.z = this.depth[0]!;
    item.group = group;
    return item;
  }
}

/** Have a renderer keep its lists from picture to picture; anew when its context was lost. */
export function keepLists(renderer: WebGLRenderer): void {
  let lists = new WeakMap<Scene, RenderList[]>();
  const get = (scene: Scene, depth: number): RenderList => {
    let own = lists.get(scene);
    if (!own) {
      own = [];
      lists.set(scene, own);
    }
    own[depth] ??= new RenderList();
    return own[depth]!;
  };
  const dispose = (): void => {
    lists = new WeakMap();
  };
  Object.assign(renderer.renderLists, { get, dispose });
}

/** Whether one is drawn after another; equal ones in the order in which they were made. */
function after(a: Item, b: Item, farFirst: boolean): boolean {
  if (a.groupOrder !== b.groupOrder) return a.groupOrder > b.groupOrder;
  if (a.renderOrder !== b.renderOrder) return a.renderOrder > b.renderOrder;
  if (!farFirst) {
    if (a.material!.id !== b.material!.id) return a.material!.id > b.material!.id;
    if (a.materialVariant !== b.materialVariant) return a.materialVariant > b.materialVariant;
  }
  if (a.z !== b.z) return farFirst ? a.z < b.z : a.z > b.z;
  return a.id > b.id;
}

/** Sort in place, and equal ones stay as they are: an array's own sort copies it. */
function sort(list: Item[], farFirst: boolean): void {
  const n = list.length;
  for (let from = 0; from < n; from += STRETCH) {
    const to = Math.min(from + STRETCH, n);
    for (let i = from + 1; i < to; i += 1) {
      const item = list[i]!;
      let k = i;
      for (; k > from && after(list[k - 1]!, item, farFirst); k -= 1) list[k] = list[k - 1]!;
      list[k] = item;
    }
  }
  for (let width = STRETCH; width < n; width *= 2) {
    for (let from = 0; from + width < n; from += 2 * width) {
      const middle = from + width;
      const to = Math.min(middle + width, n);
      if (!after(list[middle - 1]!, list[middle]!, farFirst)) continue;
      for (let i = 0; i < width; i += 1) aside[i] = list[from + i]!;
      let left = 0;
      let right = middle;
      for (let k = from; left < width; k += 1) {
        if (right < to && after(aside[left]!, list[right]!, farFirst)) {
          list[k] = list[right]!;
          right += 1;
        } else {
          list[k] = aside[left]!;
          left += 1;
        }
      }
    }
  }
}
