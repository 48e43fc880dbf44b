// Checks GLB files with the Khronos validator: `node glb.js FILE…`. Ends with 1 if any has an error.
import { readFile } from "node:fs/promises";
import validator from "gltf-validator";

let [errors, warnings] = [0, 0];
for (const file of process.argv.slice(2)) {
  const { issues } = await validator.validateBytes(new Uint8Array(await readFile(file)), { maxIssues: 20 });
  errors += issues.numErrors;
  warnings += issues.numWarnings;
  if (issues.numErrors + issues.numWarnings > 0) {
    console.log(`${file}: ${issues.numErrors} errors, ${issues.numWarnings} warnings`);
    for (const { severity, code, message, pointer } of issues.messages.filter((m) => m.severity < 2)) {
      console.log(`  ${["error", "warning"][severity]} ${code} at ${pointer}: ${message}`);
    }
  }
}
console.log(`${process.argv.length - 2} GLB files: ${errors} errors, ${warnings} warnings`);
process.exit(errors > 0 ? 1 : 0);
