// Matrices of three.js in typed arrays. In plain arrays V8 keeps their numbers as objects of their own once kinds of
// elements are mixed, and each product of two matrices then allocates sixteen: 90 kB per picture of 50 bodies.

import type { Plugin } from "vite";

const ELEMENTS = /this\.elements = \[([\s\d,]+)\];/g;
/** Of Matrix2, Matrix3 and Matrix4. */
const CLASSES = 3;

export function typedMatrices(): Plugin {
  return {
    name: "typed-matrices",
    transform(code, id) {
      if (!/\/three\/build\/three\.(core|module)\.js$/.test(id)) return null;
      const found = code.match(ELEMENTS)?.length ?? 0;
      if (found === 0) return null;
      if (found !== CLASSES) this.error(`three.js has ${found} matrices where ${CLASSES} were expected`);
      return { code: code.replace(ELEMENTS, "this.elements = new Float64Array([$1]);"), map: null };
    },
  };
}
