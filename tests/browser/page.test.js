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
    const instructions = await page.evaluate(() => window.sbdp.scene.instructions);
    assert.equal(await page.locator("#steps button").count(), instructions.length, "a row per instruction");
    assert.ok(instructions.length < ends.length, "equal steps share a row");
    await page.locator("#steps button").nth(1).click();
    await page.evaluate(() => window.sbdp.player.setSpeed(20));
    const last = ends[instructions[1].steps.at(-1)];
    await page.waitForFunction((end) => window.sbdp.player.time === end && !window.sbdp.player.playing, last);
    await page.keyboard.press("Home");
    assert.equal(await time(page), 0);
    assert.match(await page.locator("#now").textContent(), /^Step 1 of/);
    const rows = await page.locator("#steps button").allTextContents();
    assert.deepEqual(rows, instructions.map((i) => i.numbers + i.words));
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
    await page.getByLabel("All parts").check();
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

/** The names in the blocking graph, as boxes show them. */
const boxes = (page) => page.locator("#graph .node title").allTextContents();

test("the blocking graph shows the parts that matter for what is looked at", () =>
  visited(complete, async (page) => {
    await page.getByRole("tab", { name: "Blocking" }).click();
    const { parts, steps, graphs } = await page.evaluate(() => window.sbdp.scene);
    const expected = (graph, about) => {
      const near = graph.edges.filter((edge) => edge.some((p) => about.includes(p))).flat();
      return new Set([...about, ...near].map((p) => parts[p].name));
    };
    let fewest = parts.length;
    for (const graph of graphs) {
      await page.evaluate(() => window.sbdp.selection.pick(null));
      await page.getByLabel("Direction").selectOption({ label: graph.direction });
      const shown = await boxes(page);
      assert.deepEqual(new Set(shown), expected(graph, steps[0].parts), graph.direction);
      fewest = Math.min(fewest, shown.length);
      await page.evaluate((part) => window.sbdp.selection.pick(part), parts.length - 1);
      assert.deepEqual(new Set(await boxes(page)), expected(graph, [parts.length - 1]), graph.direction);
    }
    assert.ok(fewest < parts.length, "everything is always shown");
    assert.match(await page.locator("#shown").textContent(), new RegExp(parts.at(-1).name));
  }));

test("the blocking graph of an incomplete plan shows what is stuck", () =>
  visited(infeasible, async (page) => {
    await page.getByRole("tab", { name: "Blocking" }).click();
    const { parts, blocked } = await page.evaluate(() => window.sbdp.scene);
    const stuck = new Set(blocked.map((b) => parts[b.part].name));
    const shown = await boxes(page);
    assert.ok(stuck.size > 0 && [...stuck].every((name) => shown.includes(name)), `${shown}`);
    assert.match(await page.locator("#shown").textContent(), /stuck/);
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

/** Of each part its colour, its opacity as drawn, and whether it is seen. */
const looks = (page) =>
  page.evaluate(() => {
    const { stage } = window.sbdp;
    stage.invalidate();
    stage.draw();
    return stage.bodies.map((b) => ({
      colour: `#${b.material.color.getHexString()}`,
      opacity: b.group.visible ? b.opacity : 0,
    }));
  });

test("of each step the moving parts are in one colour with an arrow, and what left before is gone", () =>
  visited(complete, async (page) => {
    const { steps, colours } = await page.evaluate(() => window.sbdp.scene);
    const gone = new Set();
    for (const [i, step] of steps.entries()) {
      await page.evaluate((time) => window.sbdp.player.seek(time), (step.begins + step.ends) / 2);
      const all = await looks(page);
      all.forEach(({ colour, opacity }, part) => {
        assert.equal(colour === colours.moving, step.parts.includes(part), `part ${part} at step ${i}`);
        assert.equal(opacity === 0, gone.has(part), `part ${part} at step ${i}`);
      });
      const arrows = await page.evaluate(() => [...window.sbdp.stage.arrows].filter(([, a]) => a.visible).map(([s]) => s));
      assert.deepEqual(arrows, [i]);
      step.parts.forEach((part) => gone.add(part));
    }
  }));

test("what hides the moving parts is see-through by itself", () =>
  visited(complete, async (page) => {
    const instructions = await page.evaluate(() => window.sbdp.scene.instructions);
    const hidden = instructions.find((i) => i.hiding.length > 0);
    assert.ok(hidden, "nothing hides anything here");
    await page.evaluate((step) => window.sbdp.player.seek(window.sbdp.scene.steps[step].begins), hidden.steps[0]);
    const all = await looks(page);
    assert.ok(hidden.hiding.every((part) => all[part].opacity < 0.5));
    await page.evaluate((part) => window.sbdp.selection.pick(part), hidden.hiding[0]);
    assert.ok((await looks(page)).every(({ opacity }) => opacity === 0 || opacity === 1), "who points decides");
  }));

test("the camera goes to the side of the instruction, unless it is told not to", () =>
  visited(complete, async (page) => {
    const instructions = await page.evaluate(() => window.sbdp.scene.instructions);
    const angle = (view) =>
      page.evaluate((view) => {
        const { camera, controls } = window.sbdp.stage;
        const back = camera.position.clone().sub(controls.target).normalize();
        return Math.acos(Math.min(1, back.x * view[0] + back.y * view[1] + back.z * view[2]));
      }, view);
    const other = instructions.find((i) => i.view.join() !== instructions[0].view.join());
    assert.ok(other, "all instructions are seen from one side");
    const go = ({ steps }) => page.evaluate((step) => window.sbdp.player.seek(window.sbdp.scene.steps[step].begins), steps[0]);
    await go(other);
    await page.waitForFunction(() => !window.sbdp.stage.swing);
    assert.ok((await angle(other.view)) < 0.02);
    await page.getByRole("button", { name: "Follow" }).click();
    await go(instructions[0]);
    await page.waitForTimeout(200);
    assert.ok((await angle(other.view)) < 0.02, "it stays");
  }));

test("names are at the moving parts, at the pointer, and everywhere if wanted", () =>
  visited(complete, async (page) => {
    const { parts, steps } = await page.evaluate(() => window.sbdp.scene);
    const shown = () => page.locator("#labels .label:not(.hover):not(.left-out):not([hidden])").allTextContents();
    assert.deepEqual(await shown(), steps[0].parts.map((p) => parts[p].name));
    await page.getByRole("button", { name: "Names" }).click();
    await page.waitForFunction((n) => document.querySelectorAll("#labels .label:not(.hover):not(.left-out):not([hidden])").length === n, parts.length);
    const box = await page.locator("canvas").boundingBox();
    await page.mouse.move(box.x + box.width / 2, box.y + box.height / 2);
    const under = await page.evaluate(([x, y]) => window.sbdp.stage.pick(x, y), [box.x + box.width / 2, box.y + box.height / 2]);
    assert.equal(await page.locator(".label.hover").textContent(), parts[under].name);
  }));

test("names do not overlap, from no side, and those that do not fit are counted", () =>
  visited(complete, async (page) => {
    await page.getByRole("button", { name: "Names" }).click();
    const count = await page.evaluate(() => window.sbdp.scene.parts.length);
    for (let side = 0; side < 6; side += 1) {
      await page.keyboard.press("Shift+ArrowRight");
      // Further away, names come closer together.
      await page.keyboard.press("-");
      await pixels(page);
      const seen = await page.locator("#labels .label:not(.hover):not(.left-out):not([hidden])").evaluateAll((all) =>
        all.map((e) => e.getBoundingClientRect()).map(({ left, right, top, bottom }) => ({ left, right, top, bottom })),
      );
      const overlap = (a, b) => a.left < b.right && b.left < a.right && a.top < b.bottom && b.top < a.bottom;
      seen.forEach((a, i) => seen.slice(i + 1).forEach((b) => assert.ok(!overlap(a, b), `${JSON.stringify([a, b])} at side ${side}`)));
      assert.equal(await page.locator(".leaders line").count(), seen.length, "a line leads from each to its part");
      const left = Number.parseInt((await page.locator(".label.left-out:not([hidden])").allTextContents())[0] ?? "0", 10);
      assert.equal(seen.length + left, count);
    }
  }));

test("it is dark where the system is, and the button changes that", () =>
  visited(
    complete,
    async (page) => {
      const ground = async () => [...(await pixels(page)).subarray(0, 3)];
      const dark = await ground();
      assert.ok(dark.every((c) => c < 60), `${dark}`);
      await page.getByRole("button", { name: "Dark" }).click();
      const light = await ground();
      assert.ok(light.every((c) => c > 200), `${light}`);
    },
    { colorScheme: "dark" },
  ));

test("a sheet with a picture per instruction is printed", () =>
  visited(complete, async (page) => {
    const before = await page.evaluate(() => window.sbdp.stage.camera.position.toArray());
    await page.evaluate(() => window.dispatchEvent(new Event("beforeprint")));
    const sources = await page.locator("#sheet img").evaluateAll((all) => all.map((e) => e.src));
    const count = await page.evaluate(() => window.sbdp.scene.instructions.length);
    assert.equal(new Set(sources).size, count);
    await page.emulateMedia({ media: "print" });
    assert.ok(await page.locator("#sheet").isVisible());
    assert.ok(!(await page.locator("main").isVisible()));
    await page.evaluate(() => window.dispatchEvent(new Event("afterprint")));
    assert.equal(await page.locator("#sheet img").count(), 0);
    const after = await page.evaluate(() => window.sbdp.stage.camera.position.toArray());
    assert.ok(before.every((x, i) => Math.abs(x - after[i]) < 1e-6 * Math.hypot(...before)), `${before} ${after}`);
  }));

test("what is stuck has colours of its own and is drawn apart by its centres", () =>
  visited(infeasible, async (page) => {
    const { colours, blocked } = await page.evaluate(() => window.sbdp.scene);
    const stuck = [...new Set(blocked.map((b) => b.part))];
    const all = await looks(page);
    assert.ok(stuck.every((part) => colours.stuck.includes(all[part].colour)), JSON.stringify(all));
    assert.ok(new Set(stuck.map((part) => all[part].colour)).size > 1, "two that hold each other are told apart");
    const distance = () =>
      page.evaluate(([a, b]) => window.sbdp.stage.bodies[a].group.position.distanceTo(window.sbdp.stage.bodies[b].group.position), stuck);
    const together = await distance();
    await page.getByLabel("Explode").fill("1");
    await looks(page);
    assert.ok((await distance()) > together * 1.2);
  }));

test("groups that can begin to move have one colour each", () =>
  visited(join(folder, "kept.html"), async (page) => {
    const { colours, free_together, duration } = await page.evaluate(() => window.sbdp.scene);
    await page.evaluate((time) => window.sbdp.player.seek(time), duration);
    await page.evaluate(() => window.sbdp.player.seek(window.sbdp.scene.duration));
    const all = await looks(page);
    free_together.forEach(({ parts }, k) => {
      assert.ok(parts.every((part) => all[part].colour === colours.free[k % colours.free.length]), JSON.stringify(all));
    });
  }));

for (const [what, viewport] of [["upright", { width: 390, height: 844 }], ["on its side", { width: 844, height: 390 }]]) {
  test(`it fits a phone ${what}`, () =>
    visited(
      complete,
      async (page) => {
        const overflow = await page.evaluate(() => [
          document.documentElement.scrollWidth - window.innerWidth,
          document.documentElement.scrollHeight - window.innerHeight,
        ]);
        assert.ok(overflow.every((x) => x <= 0), `${overflow} pixels too large`);
        const box = await page.locator("canvas").boundingBox();
        assert.ok(box.height > viewport.height / 3 && box.width > viewport.width * 0.5, JSON.stringify(box));
        const list = await page.locator("#steps").boundingBox();
        assert.ok(list.y + 60 < viewport.height, "the steps are not seen");
      },
      { viewport, hasTouch: true },
    ));
}

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
