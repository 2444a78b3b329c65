// What a visitor's hands take and pull: a workpiece or a control that they are at, or that the beam meets.

import { effect } from "@preact/signals";
import { Raycaster, Vector3 } from "three";
import { controlOf, grab, isLoose, press, pull, refused, release, standsAt } from "../doing";
import { scene } from "../page_state";
import { nodeAlong } from "../scene/picking";
import type { Viewer } from "../scene/viewer";
import type { ControlInfo } from "../wire";

/** A hand is at what is no farther than this from it [m]. */
const NEAR = 0.2;
/** All of a lever's way is so much of a hand's, upward [m]. */
const TRAVEL = 0.3;

interface Pulling {
  control: ControlInfo;
  from: number;
  height: number;
}

export class Hands {
  private readonly ray = new Raycaster();
  private readonly at = new Vector3();
  private readonly held = new Map<XRHandedness, string>();
  private readonly pulling = new Map<XRHandedness, Pulling>();
  private readonly forget: () => void;

  /**
   * @param human Whose hands they are; null for a visitor who looks, and who pulls all the same.
   */
  constructor(
    private readonly viewer: Viewer,
    private readonly human: string | null,
  ) {
    // What the server does not take, the hand does not have: it may close again.
    this.forget = effect(() => {
      const what = refused.value?.what;
      for (const side of ["left", "right"] as const) if (what === this.handName(side)) this.held.delete(side);
    });
  }

  /** What a hand holds now. */
  holds(side: XRHandedness): string {
    return this.held.get(side) ?? this.pulling.get(side)?.control.name ?? "";
  }

  /**
   * A hand closes.
   *
   * @param place Where it is, in the world.
   * @param from Where it points from.
   * @param along Which way.
   * @returns Whether it has something then.
   */
  close(side: XRHandedness, place: Vector3, from: Vector3, along: Vector3): boolean {
    if (this.holds(side)) return true;
    this.ray.set(from, along);
    const name = this.nearest(place) ?? nodeAlong(this.ray, this.viewer.bodies);
    const node = scene.peek()?.nodes.find((each) => each.name === name);
    if (!node) return false;
    if (isLoose(node) && this.human !== null) {
      this.held.set(side, node.owner);
      grab(this.handName(side), node.owner);
      return true;
    }
    const control = controlOf(node);
    if (!control) return false;
    this.pulling.set(side, { control, from: standsAt(control), height: place.y });
    if (control.kind !== "lever") press(control);
    return true;
  }

  /** A hand that pulls moves. */
  move(side: XRHandedness, place: Vector3): void {
    const pulling = this.pulling.get(side);
    if (pulling?.control.kind !== "lever") return;
    const { control, from, height } = pulling;
    const to = from + ((control.upper - control.lower) * (place.y - height)) / TRAVEL;
    const clipped = Math.min(Math.max(to, control.lower), control.upper);
    if (Math.abs(clipped - standsAt(control)) > 0.005 * (control.upper - control.lower))
      pull(control, clipped);
  }

  /** A hand opens. */
  open(side: XRHandedness): void {
    if (this.held.delete(side)) grab(this.handName(side), "");
    const pulling = this.pulling.get(side);
    this.pulling.delete(side);
    if (pulling) release(pulling.control);
  }

  /** Let go of everything. */
  end(): void {
    this.forget();
    for (const side of ["left", "right"] as const) this.open(side);
  }

  private handName(side: XRHandedness): string {
    return `${this.human}/${side}_hand`;
  }

  private nearest(place: Vector3): string | null {
    let found: string | null = null;
    let least = NEAR;
    for (const node of scene.peek()?.nodes ?? []) {
      if (!(isLoose(node) && this.human !== null) && !controlOf(node)) continue;
      const body = this.viewer.bodies.byName.get(node.name);
      if (!body) continue;
      const far = body.group.getWorldPosition(this.at).distanceTo(place);
      if (far < least) [least, found] = [far, node.name];
    }
    return found;
  }
}
