// Pack scripts, which weigh a quarter then in an installation; Python unpacks them.

import { readdirSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { gzipSync } from "node:zlib";

const page = "../src/seerob/app/server/page";
for (const file of readdirSync(page, { recursive: true })) {
  if (!file.endsWith(".js")) continue;
  writeFileSync(`${page}/${file}.gz`, gzipSync(readFileSync(`${page}/${file}`), { level: 9 }));
  rmSync(`${page}/${file}`);
}
