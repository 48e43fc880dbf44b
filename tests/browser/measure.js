// Figures of a page: `node measure.js PAGE…`. Its size, when the first picture is there, pictures per second while it
// plays; drawn in software, so on a machine with a graphics card they are better. `--shots FOLDER` takes pictures of
// the beginning, of a part moving out, of the exploded view and of what is stuck.
import { stat } from "node:fs/promises";
import { basename, join } from "node:path";
import { launch, open } from "./browser.js";

const files = process.argv.slice(2);
const at = files.indexOf("--shots");
const [, folder] = at < 0 ? [] : files.splice(at, 2);
const browser = await launch();
for (const file of files) {
  const { page, context } = await open(browser, file);
  const first = await page.evaluate(() => performance.getEntriesByName("first-frame")[0].startTime);
  const fps = await page.evaluate(async (seconds) => {
    const { player, stage } = window.sbdp;
    if (player.scene.duration === 0) return null;
    let count = 0;
    const draw = stage.draw.bind(stage);
    stage.draw = () => {
      const drew = draw();
      if (drew) count += 1;
      return drew;
    };
    player.play();
    const start = performance.now();
    await new Promise((done) => setTimeout(done, seconds * 1000));
    player.pause();
    stage.draw = draw;
    return (count * 1000) / (performance.now() - start);
  }, 6);
  const { size } = await stat(file);
  const playing = fps === null ? "nothing moves" : `${fps.toFixed(1)} pictures per second`;
  console.log(
    `${basename(file)}: ${(size / 1e3).toFixed(0)} kB, first picture after ${first.toFixed(0)} ms, ${playing}`,
  );
  if (folder) await shots(page, join(folder, basename(file, ".html")));
  await context.close();
}
await browser.close();

async function shots(page, name) {
  const shot = async (what) => {
    await page.waitForTimeout(300);
    await page.screenshot({ path: `${name}-${what}.png` });
  };
  const seek = (share) =>
    page.evaluate((u) => {
      const { player, scene } = window.sbdp;
      const step = scene.steps[Math.floor(scene.steps.length / 2)];
      player.seek(u === 0 ? 0 : step ? step.begins + (step.ends - step.begins) * u : 0);
    }, share);
  await seek(0);
  await shot("begin");
  await seek(0.6);
  await shot("moving");
  await page.getByLabel("Explode").fill("1");
  await shot("exploded");
  await page.keyboard.press("e");
  await page.getByRole("tab", { name: "Blocking" }).click();
  await shot("graph");
  if (await page.locator("#stuck button").count()) {
    await page.locator("#stuck button").first().click();
    await shot("stuck");
  }
}
