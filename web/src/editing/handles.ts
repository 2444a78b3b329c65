// How what is selected is moved: by which handles, and in which steps.

import { remembered } from "../remembered";
import { word } from "../words";

export const gizmoMode = remembered("seerob.gizmo", [word("move"), word("turn")] as const, "move");

/** Steps of handles: length [m] and angle [°]; 0 for none. */
export const STEPS = { none: [0, 0], fine: [0.001, 1], middle: [0.01, 5], coarse: [0.1, 15] } as const;
export const STEP_NAMES = ["none", "fine", "middle", "coarse"] as const;
export const steps = remembered("seerob.steps", STEP_NAMES, "middle");

/** Unit in which places are written in the page. */
export const lengthUnit = remembered("seerob.length", ["m", "mm"] as const, "m");
