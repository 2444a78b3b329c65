// Above each robot, person and machine that may be elsewhere: why.

import { Box3, Group } from "three";
import type { Doubts } from "../doubts";
import { Caption } from "../markers/caption";
import { manner, spoken } from "../units";
import type { Scene } from "../wire";
import type { Bodies } from "./bodies";

export class DoubtCaptions {
  readonly root = new Group();
  /** Those that are written now are visible. */
  readonly captions: Caption[] = [];
  /** What each of them says of whom, and how it is said. */
  private readonly names: string[] = [];
  private readonly reasons: string[] = [];
  private manner = manner.peek();
  private readonly box = new Box3();
  private readonly part = new Box3();

  constructor(private readonly bodies: Bodies) {}

  /**
   * Write them anew; who has no body to be seen has none.
   *
   * @param most More would hide the room; the tree has all of them.
   */
  update(scene: Scene | null, doubts: Doubts, most: number): void {
    let used = 0;
    const same = this.manner === manner.peek();
    this.manner = manner.peek();
    if (doubts.size > 0)
      for (const { name } of scene?.mechanisms ?? []) {
        const reason = used < most ? doubts.get(name) : undefined;
        if (reason === undefined || !this.above(name)) continue;
        const caption = this.captionAt(used);
        this.box.getCenter(caption.object.position).z = this.box.max.z;
        caption.object.visible = true;
        // To put it into words at each picture would leave words to be thrown away.
        if (!same || this.names[used] !== name || this.reasons[used] !== reason) {
          caption.say(shortened(name, spoken(reason)), "undecided");
          this.names[used] = name;
          this.reasons[used] = reason;
        }
        used += 1;
      }
    for (let k = used; k < this.captions.length; k += 1) this.captions[k]!.object.visible = false;
  }

  private captionAt(index: number): Caption {
    let caption = this.captions[index];
    if (!caption) {
      caption = new Caption();
      this.captions.push(caption);
      this.root.add(caption.object);
    }
    return caption;
  }

  private above(owner: string): boolean {
    this.box.makeEmpty();
    for (const { node, group, extent } of this.bodies.byName.values()) {
      if (node.owner !== owner || !group.visible || extent.isEmpty()) continue;
      this.box.union(this.part.copy(extent).applyMatrix4(group.matrix));
    }
    return !this.box.isEmpty();
  }
}

// The time-out, the consequences and the like are in the tree and the table.
function shortened(name: string, reason: string): string {
  const own = reason.startsWith(`${name}: `) ? reason.slice(name.length + 2) : reason;
  return `${name}: ${own.replace(/( \(|: ).*$/, "")}`;
}
