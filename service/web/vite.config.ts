import { defineConfig } from "vitest/config";

// Addresses are relative, so that a proxy may put the page elsewhere.
export default defineConfig({
  base: "./",
  oxc: { jsx: { runtime: "automatic", importSource: "preact" } },
  build: {
    target: "es2022",
    assetsInlineLimit: 0, // the content-security policy allows no inline content
    chunkSizeWarningLimit: 250,
  },
  test: { include: ["src/**/*.test.ts"] },
});
