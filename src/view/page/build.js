// Bundles the page's script: `npm ci && node build.js`. The same sources and lock file give the same bytes.
import { build } from "esbuild";

await build({
  entryPoints: ["src/main.js"],
  outfile: "dist/page.js",
  bundle: true,
  minify: true,
  format: "iife",
  target: ["es2022"],
  charset: "ascii",
  legalComments: "eof",
  logLevel: "warning",
});
