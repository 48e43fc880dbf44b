// A headless browser with a page of sbdp's in it.
import { existsSync } from "node:fs";
import { pathToFileURL } from "node:url";
import { chromium } from "playwright-core";

const PLACES = [process.env.CHROMIUM, "/usr/bin/chromium", "/usr/bin/chromium-browser"];

/** Starts Debian's Chromium, drawing in software. */
export function launch() {
  const executablePath = PLACES.find((p) => p && existsSync(p));
  if (!executablePath) throw new Error("no Chromium: install Debian's package chromium, or name one in $CHROMIUM");
  const args = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"];
  return chromium.launch({ executablePath, args });
}

/**
 * Opens a page from disk and waits until something was drawn.
 * @param {import("playwright-core").Browser} browser
 * @param {string} file
 * @param {object} options of the browser's context
 */
export async function open(browser, file, options = {}) {
  const context = await browser.newContext({ viewport: { width: 1280, height: 800 }, ...options });
  const page = await context.newPage();
  const complaints = [];
  page.on("console", (m) => ["error", "warning"].includes(m.type()) && isOurs(m.text()) && complaints.push(m.text()));
  page.on("pageerror", (e) => complaints.push(String(e)));
  page.on("request", (r) => !/^(file|data|blob):/.test(r.url()) && complaints.push(`asked the network for ${r.url()}`));
  await page.goto(pathToFileURL(file).href);
  await page.waitForFunction(() => document.documentElement.dataset.drawn === "true", null, { timeout: 120_000 });
  return { page, context, complaints };
}

/** What the software renderer says of itself is no complaint about the page. */
function isOurs(text) {
  return !/GPU stall|swiftshader|Automatic fallback to software WebGL/i.test(text);
}

/** The canvas as RGBA bytes, read in the task that drew it. */
export async function pixels(page) {
  const text = await page.evaluate(() => {
    const { stage } = window.sbdp;
    stage.invalidate();
    stage.draw();
    const gl = stage.renderer.getContext();
    const [w, h] = [gl.drawingBufferWidth, gl.drawingBufferHeight];
    const bytes = new Uint8Array(w * h * 4);
    gl.readPixels(0, 0, w, h, gl.RGBA, gl.UNSIGNED_BYTE, bytes);
    let out = "";
    for (let i = 0; i < bytes.length; i += 8192) out += String.fromCharCode(...bytes.subarray(i, i + 8192));
    return btoa(out);
  });
  return Buffer.from(text, "base64");
}

/** The share of pixels in which two pictures differ visibly. */
export function difference(a, b) {
  if (a.length !== b.length) return 1;
  let count = 0;
  for (let i = 0; i < a.length; i += 4) {
    if (Math.abs(a[i] - b[i]) + Math.abs(a[i + 1] - b[i + 1]) + Math.abs(a[i + 2] - b[i + 2]) > 24) count += 1;
  }
  return count / (a.length / 4);
}

/** The share of pixels that are not of the most frequent colour, the background's. */
export function drawn(picture) {
  const counts = new Map();
  for (let i = 0; i < picture.length; i += 4) {
    const colour = picture.readUInt32LE(i);
    counts.set(colour, (counts.get(colour) ?? 0) + 1);
  }
  return 1 - Math.max(...counts.values()) / (picture.length / 4);
}
