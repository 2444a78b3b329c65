// What three.js and signals would allocate in each picture, and do not here.
//
// Matrices and values of uniforms in typed arrays: in plain arrays V8 keeps their numbers as objects of their own once
// kinds of elements are mixed, and each product of two matrices then allocates sixteen, each colour that is told to the
// graphics card three: 90 kB per picture of 50 bodies. A number with a fraction is kept inside of a field that has had
// numbers alone, and is an object anew for whoever hands it on; in a field that began as nothing it is one from when it was
// set, which is handed on. What is drawn and by what light is listed in memory that is kept, as an array gives its own back
// when it is emptied.

import type { Plugin } from "vite";

/** What is replaced, in which of its files, how often it is there, and by what. */
const CHANGES: readonly [RegExp, readonly string[], number, string][] = [
  [/this\.elements = \[([\s\d,]+)\];/g, ["core", "module"], 3, "this.elements = new Float64Array([$1]);"],
  [
    /(class SingleUniform \{[\s\S]{0,200}?)this\.cache = \[\];/g,
    ["module"],
    1,
    "$1this.cache = floats(activeInfo.type, 1);",
  ],
  [
    /(class PureArrayUniform \{[\s\S]{0,200}?)this\.cache = \[\];/g,
    ["module"],
    1,
    "$1this.cache = floats(activeInfo.type, activeInfo.size);",
  ],
  // What materials, lights and cameras hand on to uniforms and to cameras of a headset.
  [
    /this\.(opacity|roughness|metalness|emissiveIntensity|intensity|normalBias|near) = (\d\.?\d*|intensity|near);/g,
    ["core"],
    14,
    "this.$1 = null; this.$1 = $2;",
  ],
  // What is computed for points is written where it is another number.
  [
    /(uniforms\.(?:size|scale)\.value) = (material\.size \* pixelRatio|height \* 0\.5);/g,
    ["module"],
    2,
    "if ( $1 !== $2 ) $1 = $2;",
  ],
  // Each setter compares and copies by itself: one function for arrays of every kind hands on each number as an object.
  [
    /if \( arraysEqual\( cache, (\w+) \) \) return;/g,
    ["module"],
    15,
    "let same = cache.length === $1.length; for ( let i = 0; same && i < $1.length; i ++ ) same = cache[ i ] === $1[ i ]; if ( same ) return;",
  ],
  [
    /copyArray\( cache, (\w+) \);/g,
    ["module"],
    19,
    "for ( let i = 0; i < $1.length; i ++ ) cache[ i ] = $1[ i ];",
  ],
  // What may be a number or nothing is an object, and so is each number that is handed to WebGL by itself.
  [
    /(function setValueV3f\([^)]*\) \{\s+const cache = this\.cache;\s+)(?=if \( v\.x !== undefined \))/g,
    ["module"],
    1,
    "$1if ( v.isColor === true ) return setColor( gl, this.addr, cache, v ); if ( v.isVector3 === true ) return setVector( gl, this.addr, cache, v );",
  ],
  // A matrix that is compared with a number is written as a text first.
  [
    /if \( firstElem <= 0 \|\| firstElem > 0 \) return array;/g,
    ["module"],
    1,
    "if ( typeof firstElem === 'number' ) return array;",
  ],
  [
    /const (renderListStack|renderStateStack|lightsArray|shadowsArray) = \[\];/g,
    ["module"],
    4,
    "const $1 = new Kept();",
  ],
  // What is told of planes is made where somebody listens.
  [
    /if \( frame\.detectedPlanes \)/g,
    ["module"],
    1,
    "if ( frame.detectedPlanes && scope._listeners?.planesdetected )",
  ],
  // A function that compares is made where there is something to compare.
  [/(?=lightProbeGridArray\.sort\()/g, ["module"], 1, "if ( lightProbeGridArray.length > 1 ) "],
  // How deep something lies is handed to the page's own list (scene/render_list.ts) in memory, not as an object for each
  // mesh; nor are planes.
  [
    /groupOrder, _vector4\.z, /g,
    ["module"],
    3,
    "groupOrder, ( currentRenderList.depth[ 0 ] = _vector4.z, 0 ), ",
  ],
  [
    /(planes\[ \d \])\.setComponents\( ([^,;]+), ([^,;]+), ([^,;]+), ([^,;]+) \)\.normalize\(\);/g,
    ["core"],
    9,
    "{ const { normal } = $1; normal.x = $2; normal.y = $3; normal.z = $4; $1.constant = $5; $1.normalize(); }",
  ],
];

// Floats of a number, of vectors and of matrices, by WebGL's kinds of uniforms; and a list that keeps its memory.
const ADDED = `
const FLOATS = { 0x1406: 1, 0x8b50: 2, 0x8b51: 3, 0x8b52: 4, 0x8b5a: 4, 0x8b5b: 9, 0x8b5c: 16 };
function floats(type, size) { return FLOATS[type] ? new Float64Array(FLOATS[type] * size).fill(NaN) : []; }
const floats3 = new Float32Array(3);
function setColor(gl, addr, cache, { r, g, b }) {
  if (cache[0] === r && cache[1] === g && cache[2] === b) return;
  floats3[0] = cache[0] = r;
  floats3[1] = cache[1] = g;
  floats3[2] = cache[2] = b;
  gl.uniform3fv(addr, floats3);
}
function setVector(gl, addr, cache, { x, y, z }) {
  if (cache[0] === x && cache[1] === y && cache[2] === z) return;
  floats3[0] = cache[0] = x;
  floats3[1] = cache[1] = y;
  floats3[2] = cache[2] = z;
  gl.uniform3fv(addr, floats3);
}
class Kept {
  constructor() { this.length = 0; }
  push(one) { this[this.length] = one; this.length += 1; }
  pop() { this.length -= 1; return this[this.length]; }
  sort(order) {
    for (let i = 1; i < this.length; i += 1) {
      const one = this[i];
      let k = i;
      for (; k > 0 && order(this[k - 1], one) > 0; k -= 1) this[k] = this[k - 1];
      this[k] = one;
    }
  }
}
`;

// A signal that is peeked at makes a function each time, with what it closes over; a picture peeks at dozens.
const PEEK =
  /\.prototype\.peek=function\(\)\{(?:var i=this;return (\w+)\(function\(\)\{return i\.value\}\)|return (\w+)\(\(\)=>this\.value\))\}/g;
const PEEKED = ".prototype.peek=function(){peekedAt=this;return $1$2(valueOfPeeked)}";
const PEEK_ADDED = "\nvar peekedAt;function valueOfPeeked(){return peekedAt.value}\n";

export function withoutGarbage(): Plugin {
  return {
    name: "without-garbage",
    transform(code, id) {
      if (/\/signals-core\/dist\/signals-core\.(module\.js|mjs)$/.test(id)) {
        const found = code.match(PEEK)?.length ?? 0;
        if (found !== 1) this.error(`signals have ${found} of ${PEEK} where one was expected`);
        // What is last may be a comment.
        return { code: code.replace(PEEK, PEEKED) + PEEK_ADDED, map: null };
      }
      const file = /\/three\/build\/three\.(core|module)\.js$/.exec(id)?.[1];
      if (!file) return null;
      let changed = code;
      for (const [what, files, count, by] of CHANGES) {
        const found = code.match(what)?.length ?? 0;
        // Matrices are in one of both files.
        if (found === 0 && files.length > 1) continue;
        if (!files.includes(file)) continue;
        if (found !== count) this.error(`three.js has ${found} of ${what} where ${count} were expected`);
        changed = changed.replace(what, by);
      }
      return { code: file === "module" ? changed + ADDED : changed, map: null };
    },
  };
}
