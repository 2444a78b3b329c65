// Pack the scene for notebooks, which weighs a quarter then in an installation; Python unpacks it.

import { readFileSync, rmSync, writeFileSync } from "node:fs";
import { gzipSync } from "node:zlib";

const script = "../src/seerob/app/server/page/notebook.js";
writeFileSync(`${script}.gz`, gzipSync(readFileSync(script), { level: 9 }));
rmSync(script);
