/**
 * From decoded numbers to three.js objects.
 * @import { Mesh, Part } from "./data.js"
 */
import {
  BufferAttribute,
  BufferGeometry,
  DoubleSide,
  Group,
  InterleavedBuffer,
  InterleavedBufferAttribute,
  LineBasicMaterial,
  LineSegments,
  Mesh as Surface,
  MeshLambertMaterial,
} from "three";

/** Opacity of edges. */
const EDGE = 0.6;

/**
 * The surface and the sharp edges of a mesh; both share the vertices.
 * @param {Mesh} mesh
 */
export function geometries(mesh) {
  const positions = new InterleavedBufferAttribute(new InterleavedBuffer(mesh.positions, 4), 3, 0);
  const normals = new InterleavedBufferAttribute(new InterleavedBuffer(mesh.normals, 4), 3, 0, true);
  const surface = new BufferGeometry().setAttribute("position", positions).setAttribute("normal", normals);
  surface.setIndex(new BufferAttribute(mesh.triangles, 1));
  const edges = new BufferGeometry().setAttribute("position", positions);
  edges.setIndex(new BufferAttribute(mesh.edges, 1));
  return { surface, edges };
}

/** A part as it is drawn: a group at the middle of its box, with its surface and its edges. */
export class Body {
  /**
   * @param {Part} part
   * @param {Mesh} mesh
   * @param {ReturnType<typeof geometries>} shape shared by equal parts
   * @param {string} colour
   * @param {number} index of the part
   */
  constructor(part, mesh, shape, colour, index) {
    // Edges are drawn a little nearer than faces, else they drown in them.
    const offset = { polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1 };
    this.material = new MeshLambertMaterial({ color: colour, side: DoubleSide, ...offset });
    this.line = new LineBasicMaterial({ color: "#1b2330", transparent: true, opacity: EDGE });
    this.surface = new Surface(shape.surface, this.material);
    this.edges = new LineSegments(shape.edges, this.line);
    this.surface.userData.part = index;
    this.group = new Group();
    this.group.name = part.name;
    for (const object of [this.surface, this.edges]) {
      object.position.fromArray(mesh.origin);
      object.scale.setScalar(mesh.step);
      this.group.add(object);
    }
    this.opacity = 1;
  }

  /** @param {import("./data.js").Placement} p */
  place(p) {
    this.group.position.set(p[0], p[1], p[2]);
    this.group.quaternion.set(p[3], p[4], p[5], p[6]);
  }

  /** @param {number} opacity 0 hides it */
  fade(opacity) {
    this.group.visible = opacity > 0.01;
    if (opacity === this.opacity) return;
    const solid = opacity >= 1;
    // Another kind of material is compiled anew: only when it changes.
    if (this.material.transparent === solid) this.material.needsUpdate = true;
    Object.assign(this.material, { transparent: !solid, depthWrite: solid, opacity });
    this.line.opacity = EDGE * Math.max(opacity, 0.5 * Math.min(1, opacity * 4));
    this.opacity = opacity;
  }

  /** Draws its edges through all that is before them, or not.
   * @param {boolean} on */
  outline(on) {
    this.line.depthTest = !on;
    this.edges.renderOrder = on ? 1 : 0;
  }

  /**
   * @param {string} colour
   * @param {string} glow
   * @param {string} edge
   */
  paint(colour, glow, edge) {
    this.material.color.set(colour);
    this.material.emissive.set(glow);
    this.line.color.set(edge);
  }
}
