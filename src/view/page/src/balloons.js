/**
 * Where names are written so that no two overlap: each as near to its part as the earlier ones allow. In the way of greedy
 * point-feature labelling (Christensen, Marks and Shieber 1995), with places on rings about the part. What finds no place
 * is left out.
 *
 * @typedef {{x: number, y: number, width: number, height: number}} Box left, top and size, CSS pixels
 * @typedef {{x: number, y: number, width: number, height: number}} Wanted the point that is named, and the size of its name
 */

/** Pixels between a part's middle and its name, ring by ring. At half, names hide what they name; at double, fewer fit. */
const RINGS = [12, 28, 46, 66, 88];
/** Directions on a ring, the first ones preferred: up to the right, then around. Twice as many find few places more. */
const DIRECTIONS = [1, 15, 7, 9, 3, 13, 5, 11, 0, 8, 4, 12].map((k) => [Math.cos((k * Math.PI) / 8), -Math.sin((k * Math.PI) / 8)]);
/** Pixels between two names. */
const GAP = 2;
/** After so many names without a place the picture is full, and no further one is tried: each took all places. */
const FULL = 40;

/**
 * The places of names, in the order in which they come; `null` for those that are left out.
 * @param {Wanted[]} wanted
 * @param {{width: number, height: number}} picture
 * @returns {(Box | null)[]}
 */
export function arranged(wanted, picture) {
  const placed = [];
  let failed = 0;
  return wanted.map((name) => {
    const free = failed < FULL ? places(name).find((box) => isInside(box, picture) && !placed.some((p) => overlap(p, box))) : null;
    if (free) placed.push(free);
    else failed += 1;
    return free ?? null;
  });
}

/** @param {Wanted} name */
function places({ x, y, width, height }) {
  return RINGS.flatMap((ring) =>
    DIRECTIONS.map(([right, down]) => ({
      x: x + right * ring + (Math.sign(Math.round(right * 4)) - 1) * (width / 2),
      y: y + down * ring + (Math.sign(Math.round(down * 4)) - 1) * (height / 2),
      width,
      height,
    })),
  );
}

/** The point of a name's box that is nearest to its part: where the leader line ends.
 * @param {Box} box
 * @param {{x: number, y: number}} part */
export function nearest({ x, y, width, height }, part) {
  return { x: Math.min(Math.max(part.x, x), x + width), y: Math.min(Math.max(part.y, y), y + height) };
}

/** Whether two names come closer than the gap.
 * @param {Box} a
 * @param {Box} b */
export function overlap(a, b, gap = GAP) {
  return (
    a.x < b.x + b.width + gap && b.x < a.x + a.width + gap && a.y < b.y + b.height + gap && b.y < a.y + a.height + gap
  );
}

function isInside({ x, y, width, height }, picture) {
  return x >= 0 && y >= 0 && x + width <= picture.width && y + height <= picture.height;
}
