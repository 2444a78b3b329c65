// Modules of the page for tests without a browser: each is bundled once and imported.

import fs from "node:fs";
import os from "node:os";
import path from "node:path";
import { fileURLToPath, pathToFileURL } from "node:url";
import { build } from "vite";

const SOURCE = path.resolve(path.dirname(fileURLToPath(import.meta.url)), "../src");
const folder = fs.mkdtempSync(path.join(os.tmpdir(), "seerob-source-"));
process.on("exit", () => fs.rmSync(folder, { recursive: true, force: true }));

/** Address of the built form of a module of src, for `import` here or in another thread. */
export async function built(name) {
  const fileName = `${name.replaceAll("/", "_")}.mjs`;
  await build({
    configFile: false,
    logLevel: "error",
    build: {
      lib: { entry: path.join(SOURCE, `${name}.ts`), formats: ["es"], fileName: () => fileName },
      outDir: folder,
      emptyOutDir: false,
      minify: false,
      target: "es2022",
    },
  });
  return pathToFileURL(path.join(folder, fileName)).href;
}

/** A module of src. */
export async function load(name) {
  return import(await built(name));
}

/** Modules of src that share what they both import, such as a signal. */
export async function together(...names) {
  const entry = Object.fromEntries(names.map((name) => [name.replaceAll("/", "_"), `${SOURCE}/${name}.ts`]));
  const outDir = fs.mkdtempSync(path.join(folder, "together-"));
  await build({
    configFile: false,
    logLevel: "error",
    build: {
      lib: { entry, formats: ["es"], fileName: (_, name) => `${name}.mjs` },
      rolldownOptions: { output: { chunkFileNames: "[name].mjs" } },
      outDir,
      minify: false,
      target: "es2022",
    },
  });
  const files = Object.keys(entry).map((name) => path.join(outDir, `${name}.mjs`));
  return Promise.all(files.map((file) => import(pathToFileURL(file).href)));
}
