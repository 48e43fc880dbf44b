/**
 * The scene as `page.rs` embeds it: JSON with base64 of little-endian numbers. Everything is in the input's units
 * and directions, about the middle of the assembly's box.
 *
 * @typedef {{x: number, y: number, z: number}} Vector
 * @typedef {number[] | Float32Array} Placement `[x, y, z, qx, qy, qz, qw]` of a part's middle
 *
 * @typedef {object} Mesh
 * @property {number} step length of one of the 65535 steps in which positions are given
 * @property {number[]} origin where step 0 is, from the part's middle
 * @property {Uint16Array} positions four numbers per vertex, the last unused
 * @property {Int8Array} normals four numbers per vertex, the last unused
 * @property {Uint16Array | Uint32Array} triangles
 * @property {Uint16Array | Uint32Array} edges
 *
 * @typedef {object} Part
 * @property {string} name
 * @property {number} mesh
 * @property {number} colour place in the palette
 * @property {boolean} fixed
 * @property {boolean} stays it stands in the assembly all the time
 * @property {number[]} steps that move it, ascending
 * @property {number | null} crosses when it has left the assembly, or is in it
 * @property {[number, number] | null} handled from when to when something is done to it, or to the group that it belongs
 *   to outside the assembly
 * @property {number[]} times ascending
 * @property {Float32Array} keys a placement per time
 * @property {Placement} assembled
 * @property {Placement} start where it stands before its first step
 * @property {number[]} exploded from its assembled place to that in the exploded view
 * @property {number[]} size of its box
 *
 * @typedef {object} Step
 * @property {number[]} parts
 * @property {number | null} of the step that takes out, or puts in, the group to which they belong
 * @property {number[]} body the parts of the body that they leave, or get into, as long as they are in it
 * @property {string} words
 * @property {number[]} after other parts that must have moved before
 * @property {number[]} held other parts that have to be held, if the plan says so
 * @property {number} begins
 * @property {number} ends
 *
 * @typedef {object} Instruction steps in a row that do the same with equal parts
 * @property {string | null} heading
 * @property {string} numbers of its steps
 * @property {string} words
 * @property {number[]} steps
 * @property {number[]} view unit direction to the viewer
 * @property {number[]} hiding parts that hide much of the moving ones
 * @property {{step: number, points: number[][]}[]} arrows along the ways
 *
 * @typedef {object} Group
 * @property {number[]} parts
 * @property {string} words
 *
 * @typedef {object} Graph
 * @property {string} direction
 * @property {number} rows
 * @property {number} columns
 * @property {number[][]} places column and row per part
 * @property {number[][]} edges pairs: the first is blocked by the second
 *
 * @typedef {object} Scene
 * @property {string} name
 * @property {string | null} units
 * @property {"y" | "z"} up
 * @property {"assembly" | "disassembly"} kind
 * @property {string} status
 * @property {string | null} verdict why it is not complete
 * @property {number} duration seconds
 * @property {string[]} palette
 * @property {{moving: string, held: string, stuck: string[], free: string[]}} colours with a meaning
 * @property {Instruction[]} instructions
 * @property {Mesh[]} meshes
 * @property {Part[]} parts
 * @property {Step[]} steps
 * @property {Group[]} kept_together that left together and were not taken apart
 * @property {Group[]} free_together that can begin to move where nothing leaves any more
 * @property {{part: number | null, by: number[], action: string}[]} blocked
 * @property {Graph[]} graphs
 */

/**
 * Reads the scene.
 * @param {string} text JSON
 * @returns {Scene}
 */
export function decode(text) {
  const { bytes, ...scene } = JSON.parse(text);
  const buffer = Uint8Array.from(atob(bytes), (c) => c.charCodeAt(0)).buffer;
  return { ...scene, meshes: scene.meshes.map((m) => mesh(m, buffer)), parts: scene.parts.map((p) => part(p, buffer)) };
}

function mesh(m, buffer) {
  const Index = m.index === 4 ? Uint32Array : Uint16Array;
  return {
    step: m.step,
    origin: m.origin,
    positions: new Uint16Array(buffer, m.positions, m.vertices * 4),
    normals: new Int8Array(buffer, m.normals, m.vertices * 4),
    triangles: new Index(buffer, ...m.triangles),
    edges: new Index(buffer, ...m.edges),
  };
}

function part(p, buffer) {
  return { ...p, keys: new Float32Array(buffer, p.keys, p.times.length * 7) };
}
