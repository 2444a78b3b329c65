import { defineConfig } from "vite";
import { withoutGarbage } from "./three_garbage";

// The scene for notebooks, beside the page: one module, with all that it needs in it.
export default defineConfig({
  plugins: [withoutGarbage()],
  publicDir: false,
  build: {
    lib: { entry: "src/notebook.ts", formats: ["es"], fileName: () => "notebook.js" },
    outDir: "../src/seerob/app/server/page",
    emptyOutDir: false,
    target: "es2022",
    minify: true,
    chunkSizeWarningLimit: 1500,
  },
});
