// What three.js and signals would allocate in each picture, and do not here.
//
// Matrices and values of uniforms in typed arrays: in plain arrays V8 keeps their numbers as objects of their own once
// kinds of elements are mixed, and each product of two matrices then allocates sixteen, each colour that is told to the
// graphics card three: 90 kB per picture of 50 bodies. And a stable sort in place for what is drawn: that of arrays
// copies them.

import type { Plugin } from "vite";

/** What is replaced, in which of its files, how often it is there, and by what. */
const CHANGES: readonly [RegExp, readonly string[], number, string][] = [
  [/this\.elements = \[([\s\d,]+)\];/g, ["core", "module"], 3, "this.elements = new Float64Array([$1]);"],
  [
    /(class SingleUniform \{[\s\S]{0,200}?)this\.cache = \[\];/g,
    ["module"],
    1,
    "$1this.cache = FLOATS[activeInfo.type] ? new Float64Array(FLOATS[activeInfo.type]).fill(NaN) : [];",
  ],
  [
    /(opaque|transmissive|transparent)\.sort\( (custom\w+ \|\| \w+PainterSortStable|custom\w+ \|\| \w+) \);/g,
    ["module"],
    3,
    "sortInPlace( $1, $2 );",
  ],
  // What is compared is returned as an integer; a float would be an object for each comparison.
  [/return (a|b)\.z - (a|b)\.z;/g, ["module"], 2, "return $1.z < $2.z ? -1 : 1;"],
  // How deep something lies is handed over in memory, not as an object for each mesh; nor are planes.
  [/groupOrder, _vector4\.z, /g, ["module"], 3, "groupOrder, ( howDeep[ 0 ] = _vector4.z, 0 ), "],
  [
    /(function unshift\( object, geometry, material, groupOrder, z, group \) \{)/g,
    ["module"],
    1,
    "$1 howDeep[ 0 ] = z;",
  ],
  [/renderItem\.z = z;/g, ["module"], 1, "renderItem.z = howDeep[ 0 ];"],
  [/\bz: z\b/g, ["module"], 1, "z: howDeep[ 0 ]"],
  [
    /(planes\[ \d \])\.setComponents\( ([^,;]+), ([^,;]+), ([^,;]+), ([^,;]+) \)\.normalize\(\);/g,
    ["core"],
    9,
    "{ const { normal } = $1; normal.x = $2; normal.y = $3; normal.z = $4; $1.constant = $5; $1.normalize(); }",
  ],
];

// Floats of a number and of vectors, by WebGL's kinds of uniforms.
const ADDED = `
const FLOATS = { 0x1406: 1, 0x8b50: 2, 0x8b51: 3, 0x8b52: 4 };
const aside = [];
const howDeep = new Float64Array(1);
function sortInPlace(list, order) {
  const n = list.length;
  for (let from = 0; from < n; from += 8) {
    const to = Math.min(from + 8, n);
    for (let i = from + 1; i < to; i += 1) {
      const item = list[i];
      let k = i;
      for (; k > from && order(list[k - 1], item) > 0; k -= 1) list[k] = list[k - 1];
      list[k] = item;
    }
  }
  for (let width = 8; width < n; width *= 2) {
    for (let from = 0; from + width < n; from += 2 * width) {
      const middle = from + width;
      const to = Math.min(middle + width, n);
      if (order(list[middle - 1], list[middle]) <= 0) continue;
      for (let i = 0; i < width; i += 1) aside[i] = list[from + i];
      let left = 0;
      let right = middle;
      for (let k = from; left < width; k += 1) {
        if (right < to && order(aside[left], list[right]) > 0) list[k] = list[right++];
        else list[k] = aside[left++];
      }
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
