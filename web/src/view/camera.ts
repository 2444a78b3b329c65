// The camera whose picture is behind the twin: which one is shown, and what is to be said of it.

import { computed, signal } from "@preact/signals";
import { scene } from "../page_state";
import type { CameraInfo } from "../wire";

/** Number of the camera that one looks through; null for the room. */
export const cameraShown = signal<number | null>(null);
/** Cameras of this device, where the shown one is one of them: id and label. */
export const devices = signal<readonly { id: string; label: string }[]>([]);
export const device = signal("");
/** Why there is no picture, or none of the present; empty while there is one. */
export const pictureMistake = signal("");

export const cameras = computed<readonly CameraInfo[]>(() => scene.value?.cameras ?? []);
export const camera = computed<CameraInfo | null>(() =>
  cameraShown.value === null ? null : (cameras.value[cameraShown.value] ?? null),
);

export function showCamera(number: number | null): void {
  cameraShown.value = number === cameraShown.value ? null : number;
}
