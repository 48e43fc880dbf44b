// The page in a headless browser: `SBDP_PAGES=FOLDER node --test`. The folder holds pages that `sbdp view` wrote:
// complete.html, infeasible.html, groups.html (a group is taken apart) and kept.html (one is not, and one can begin to
// move); assembly.html too, if there are assembly plans.
import assert from "node:assert/strict";
import { existsSync } from "node:fs";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { difference, drawn, launch, open, pixels } from "./browser.js";

const folder = process.env.SBDP_PAGES;
if (!folder) throw new Error("SBDP_PAGES names no folder of pages");
const complete = join(folder, "complete.html");
const infeasible = join(folder, "infeasible.html");
let browser;
before(async () => (browser = await launch()));
after(() => browser.close());

/** Opens a page, does something with it, and sees that the browser had nothing to complain about. */
async function visited(file, see, options) {
  const { page, context, complaints } = await open(browser, file, options);
  await see(page);
  assert.deepEqual(complaints, []);
  await context.close();
}

const time = (page) => page.evaluate(() => window.sbdp.player.time);

test("something is seen, and nothing is complained about", () =>
  visited(complete, async (page) => {
    const share = drawn(await pixels(page));
    assert.ok(share > 0.03, `only ${share} of the canvas is drawn on`);
    const names = await page
      .locator("button, select, input")
      .evaluateAll((all) => all.map((e) => (e.textContent + (e.labels?.[0]?.textContent ?? "")).trim()));
    assert.ok(
      names.every((name) => name),
      "a control has no label",
    );
  }));

test("it plays to the end, and pauses", () =>
  visited(complete, async (page) => {
    const first = await pixels(page);
    await page.getByRole("button", { name: "Play", exact: true }).click();
    await page.waitForFunction(() => window.sbdp.player.time > 0.3);
    await page.getByRole("button", { name: "Pause" }).click();
    const stopped = await time(page);
    assert.ok(difference(first, await pixels(page)) > 0.001, "nothing moved");
    await page.waitForTimeout(200);
    assert.equal(await time(page), stopped);
    await page.getByLabel("Speed").selectOption("20");
    await page.keyboard.press("Space");
    await page.waitForFunction(() => window.sbdp.player.time === window.sbdp.scene.duration);
    assert.match(await page.locator("#now").textContent(), /^All is apart/);
  }));

test("steps go on and back, by buttons, keys and the list", () =>
  visited(complete, async (page) => {
    await page.locator("#next").click();
    const ends = await page.evaluate(() => window.sbdp.scene.steps.map((s) => s.ends));
    assert.equal(await time(page), ends[0]);
    await page.keyboard.press("ArrowRight");
    assert.equal(await time(page), ends[1]);
    await page.locator("#previous").click();
    assert.equal(await time(page), ends[0]);
    await page.locator("#steps button").nth(1).click();
    await page.waitForFunction((end) => window.sbdp.player.time === end && !window.sbdp.player.playing, ends[1]);
    await page.keyboard.press("Home");
    assert.equal(await time(page), 0);
    assert.match(await page.locator("#now").textContent(), /^Step 1 of/);
    const after = await page.evaluate(() => window.sbdp.scene.steps.some((s) => s.after.length > 0));
    assert.equal((await page.locator("#steps .after").count()) > 0, after);
  }));

test("it explodes and comes together again", () =>
  visited(complete, async (page) => {
    const together = await pixels(page);
    await page.getByLabel("Explode").fill("1");
    const apart = await pixels(page);
    assert.ok(difference(together, apart) > 0.01, "exploding changed nothing");
    const boxes = () => page.evaluate(() => window.sbdp.stage.bodies.map((b) => b.group.position.toArray()));
    const far = await boxes();
    assert.ok(await page.evaluate(() => window.sbdp.stage.guides.visible));
    await page.keyboard.press("e");
    await pixels(page);
    assert.notDeepEqual(await boxes(), far);
    assert.equal(await page.getByLabel("Explode").inputValue(), "0");
  }));

test("parts are hidden, isolated and seen through", () =>
  visited(complete, async (page) => {
    const all = await pixels(page);
    await page.getByRole("tab", { name: "Parts" }).click();
    await page.locator("#parts button").first().click();
    const shown = () => page.evaluate(() => window.sbdp.stage.bodies.map((b) => (b.group.visible ? b.opacity : 0)));
    await page.getByRole("button", { name: "Isolate" }).click();
    assert.ok(difference(all, await pixels(page)) > 0.001);
    assert.equal((await shown()).filter((o) => o > 0).length, 1);
    await page.getByRole("button", { name: "Show all" }).click();
    await page.getByRole("button", { name: "See through" }).click();
    await pixels(page);
    const opacities = await shown();
    assert.ok(opacities[0] < 0.5 && opacities.slice(1).every((o) => o === 1), `${opacities}`);
    await page.keyboard.press("h");
    await pixels(page);
    assert.equal((await shown())[0], 0);
  }));

test("the blocking graph follows the state on show", () =>
  visited(complete, async (page) => {
    await page.getByRole("tab", { name: "Blocking" }).click();
    const parts = await page.evaluate(() => window.sbdp.scene.parts.length);
    assert.equal(await page.locator("#graph .node").count(), parts);
    await page.evaluate(() => window.sbdp.player.next());
    assert.equal(await page.locator("#graph .node.gone").count(), 1);
    assert.match(await page.locator("#free").textContent(), new RegExp(`of the ${parts - 1} parts`));
    const edges = [];
    for (const { direction } of await page.evaluate(() => window.sbdp.scene.graphs)) {
      await page.getByLabel("Direction").selectOption({ label: direction });
      edges.push(await page.locator("#graph .edge:not(.gone)").count());
    }
    assert.ok(
      edges.some((n) => n > 0),
      `${edges}`,
    );
  }));

test("the view goes around by drag and by keys, and comes back", () =>
  visited(complete, async (page) => {
    const camera = () => page.evaluate(() => window.sbdp.stage.camera.position.toArray());
    const distance = (at) => Math.hypot(...at);
    const places = [await camera()];
    await page.keyboard.press("Shift+ArrowRight");
    places.push(await camera());
    await page.keyboard.press("Shift+ArrowUp");
    places.push(await camera());
    const box = await page.locator("canvas").boundingBox();
    await page.mouse.move(box.x + box.width / 2, box.y + box.height / 2);
    await page.mouse.down();
    await page.mouse.move(box.x + box.width / 2 + 90, box.y + box.height / 2 + 20);
    await page.mouse.up();
    await page.waitForFunction((was) => window.sbdp.stage.camera.position.x !== was, places[2][0]);
    places.push(await camera());
    assert.equal(new Set(places.map((p) => p.map((x) => x.toFixed(6)).join())).size, 4, "each goes elsewhere");
    assert.equal(await page.evaluate(() => window.sbdp.selection.part), null, "a drag picks nothing");
    await page.mouse.click(box.x + box.width / 2, box.y + box.height / 2);
    assert.notEqual(await page.evaluate(() => window.sbdp.selection.part), null, "a click picks what is there");
    await page.keyboard.press("+");
    assert.ok(distance(await camera()) < distance(places[3]));
  }));

test("what is stuck stands out, with what blocks it", () =>
  visited(infeasible, async (page) => {
    assert.match(await page.locator("#verdict").textContent(), /Not complete: infeasible/);
    const before = await pixels(page);
    await page.locator("#stuck button").first().click();
    const { part, others } = await page.evaluate(() => ({
      part: window.sbdp.selection.part,
      others: [...window.sbdp.selection.others],
    }));
    const blocked = await page.evaluate(() => window.sbdp.scene.blocked);
    assert.deepEqual(new Set(others), new Set(blocked.filter((b) => b.part === part).flatMap((b) => b.by)));
    assert.ok(difference(before, await pixels(page)) > 0.001);
  }));

test("steps within a group stand further in, and groups are pointed out", () =>
  visited(join(folder, "groups.html"), async (page) => {
    const steps = await page.evaluate(() => window.sbdp.scene.steps);
    const left = (i) => page.locator("#steps button").nth(i).evaluate((e) => e.getBoundingClientRect().left);
    const inner = steps.findIndex((s) => s.of !== null);
    assert.ok(inner > 0, "the plan has no group that is taken apart");
    assert.ok((await left(inner)) > (await left(steps[inner].of)), "the step is no further in than its group");
    const before = await pixels(page);
    await page.evaluate((i) => window.sbdp.selection.pickGroup(window.sbdp.scene.steps[i].parts), steps[inner].of);
    assert.ok(difference(before, await pixels(page)) > 0.001, "the group is not pointed out");
  }));

test("groups that were kept together, or can begin to move, are listed and shown", () =>
  visited(join(folder, "kept.html"), async (page) => {
    const { kept_together, free_together } = await page.evaluate(() => window.sbdp.scene);
    for (const [list, groups] of [["#kept", kept_together], ["#free-groups", free_together]]) {
      const rows = page.locator(`${list} button`);
      assert.deepEqual(await rows.allTextContents(), groups.map((g) => g.words));
      for (const [i, { parts }] of groups.entries()) {
        await rows.nth(i).click();
        await pixels(page);
        const [group, opacities] = await page.evaluate(() => [
          [...window.sbdp.selection.group],
          window.sbdp.stage.bodies.map((b) => (b.group.visible ? b.opacity : 0)),
        ]);
        assert.deepEqual(group, parts);
        assert.ok(parts.every((p) => opacities[p] === 1), `${opacities}`);
        assert.ok(opacities.every((o, p) => parts.includes(p) || o < 1), `${opacities}`);
      }
    }
  }));

test("without motion, steps are shown by their ends", () =>
  visited(
    complete,
    async (page) => {
      await page.evaluate(() => {
        window.times = new Set();
        window.sbdp.player.addEventListener("change", () => window.times.add(window.sbdp.player.time));
        window.sbdp.player.setSpeed(20);
        window.sbdp.player.play();
      });
      await page.waitForFunction(() => window.sbdp.player.time === window.sbdp.scene.duration);
      const [times, ends, duration] = await page.evaluate(() => [
        [...window.times],
        window.sbdp.scene.steps.map((s) => s.ends),
        window.sbdp.scene.duration,
      ]);
      assert.deepEqual(
        times.filter((t) => t !== 0 && t !== duration && !ends.includes(t)),
        [],
      );
    },
    { reducedMotion: "reduce" },
  ));

test("it fits a tablet", () =>
  visited(
    complete,
    async (page) => {
      const overflow = await page.evaluate(() => document.documentElement.scrollWidth - window.innerWidth);
      assert.ok(overflow <= 0, `${overflow} pixels too wide`);
      assert.ok((await page.locator("canvas").boundingBox()).height > 200);
      await page.locator("#steps button").first().tap();
      await page.waitForFunction(() => window.sbdp.player.time > 0);
    },
    { viewport: { width: 820, height: 1180 }, hasTouch: true },
  ));

const assembly = join(folder, "assembly.html");
test("an assembly plan puts parts in", { skip: !existsSync(assembly) && "there is no assembly plan" }, () =>
  visited(assembly, async (page) => {
    const [start, end] = await page.evaluate(() => {
      const { scene, stage, player } = window.sbdp;
      const [moved] = scene.steps[0].parts;
      const at = (time) => {
        player.seek(time);
        stage.draw();
        return stage.bodies[moved].group.position.distanceTo({
          x: scene.parts[moved].assembled[0],
          y: scene.parts[moved].assembled[1],
          z: scene.parts[moved].assembled[2],
        });
      };
      return [at(0), at(scene.duration)];
    });
    assert.ok(start > 1e-3 && end < 1e-5, `${start} ${end}`);
    assert.match(await page.locator("#now").textContent(), /^All is together/);
    await page.keyboard.press("Home");
    await page.getByRole("tab", { name: "Parts" }).click();
    const seen = () =>
      page.evaluate(() => (window.sbdp.stage.draw(), window.sbdp.stage.bodies.filter((b) => b.group.visible).length));
    const all = await seen();
    await page.getByLabel("Show parts that wait").uncheck();
    assert.equal(await seen(), all - (await page.evaluate(() => window.sbdp.scene.parts.filter((p) => p.steps.length > 0).length)));
  }),
);
