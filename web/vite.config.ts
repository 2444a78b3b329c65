import { defineConfig } from "vite";
import { withoutGarbage } from "./three_garbage";

// The built page is served by seerob's own server and shipped in the wheel; nothing is inlined, so
// that a Content-Security-Policy of 'self' is enough.
export default defineConfig({
  plugins: [withoutGarbage()],
  base: "/",
  build: {
    outDir: "../src/seerob/app/server/page",
    emptyOutDir: true,
    target: "es2022",
    assetsInlineLimit: 0,
    modulePreload: { polyfill: false },
    sourcemap: false,
    chunkSizeWarningLimit: 1500,
  },
  worker: { format: "es" },
});
