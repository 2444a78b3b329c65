// What three.js and signals would allocate in each picture, and do not here.
//
// Matrices and values of uniforms in typed arrays: in plain arrays V8 keeps their numbers as objects of their own once
// kinds of elements are mixed, and each product of two matrices then allocates sixteen, each colour that is told to the
// graphics card three: 90 kB per picture of 50 bodies.

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

// Floats of a number and of vectors, by WebGL's kinds of uniforms.
const ADDED = `
const FLOATS = { 0x1406: 1, 0x8b50: 2, 0x8b51: 3, 0x8b52: 4 };
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
