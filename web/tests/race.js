// Engines on one pile in one page, in turns. web/tests/measure.mjs calls `race`.
import start, { Bare } from "./drystone_web.js";
import rapier from "rapier";
import simd from "rapier-simd";

/// Poses of all bodies: position and rotation, seven numbers each.
const POSE = 7;

class Drystone {
  constructor(scene, { substeps, backend }) {
    Object.assign(this, { backend, bare: new Bare(JSON.stringify(scene), JSON.stringify({ substeps, sleep_after: 0 })) });
  }

  ready() {
    return this.bare.use_backend(this.backend);
  }

  steps(count) {
    return this.bare.steps(count);
  }

  poses() {
    return this.bare.poses();
  }

  free() {
    this.bare.free();
  }
}

class Rapier {
  constructor(scene, { module, substeps }) {
    const [x, y, z] = scene.gravity;
    this.world = new module.World({ x, y, z });
    this.world.timestep = scene.dt;
    if (substeps !== undefined) this.world.numSolverIterations = substeps;
    this.substeps = this.world.numSolverIterations;
    this.bodies = scene.bodies.map(({ kind, position, rotation, friction, restitution, mass_properties, shapes }) => {
      const { RigidBodyDesc, ColliderDesc } = module;
      const body = kind === "fixed" ? RigidBodyDesc.fixed() : RigidBodyDesc.dynamic().setCanSleep(false);
      const q = { x: rotation[0], y: rotation[1], z: rotation[2], w: rotation[3] };
      const made = this.world.createRigidBody(body.setTranslation(...position).setRotation(q));
      for (const { type, half_extents: half } of shapes) {
        if (type !== "cuboid") throw new Error(`a ${type} in a pile of boxes`);
        const collider = ColliderDesc.cuboid(...half).setFriction(friction).setRestitution(restitution);
        if (mass_properties) collider.setDensity(mass_properties.mass / (8 * half[0] * half[1] * half[2]));
        this.world.createCollider(collider, made);
      }
      return made;
    });
  }

  async ready() {}

  async steps(count) {
    for (let k = 0; k < count; k += 1) this.world.step();
  }

  poses() {
    return new Float32Array(
      this.bodies.flatMap((body) => {
        const [p, q] = [body.translation(), body.rotation()];
        return [p.x, p.y, p.z, q.x, q.y, q.z, q.w];
      }),
    );
  }

  free() {
    this.world.free();
  }
}

const MODULES = { rapier, "rapier-simd": simd };

/// Steps a pile of boxes by each entrant, a block of steps in turn. Times (ms a step) and overlaps (mm) are those of the second half; the overlap
/// is measured by one function of drystone on the poses of each.
window.race = async ({ boxes, entrants, steps, block }) => {
  const scene = JSON.parse(Bare.pile(boxes));
  const score = new Bare(JSON.stringify(scene), "{}");
  const runs = [];
  for (const { engine, ...given } of entrants) {
    const made = engine in MODULES ? new Rapier(scene, { module: MODULES[engine], ...given }) : new Drystone(scene, given);
    await made.ready();
    runs.push({ made, times: [], overlaps: [] });
  }
  for (let done = 0; done < steps; done += block) {
    for (const { made, times, overlaps } of runs) {
      const began = performance.now();
      await made.steps(block);
      const ms = (performance.now() - began) / block;
      if (done >= steps / 2) {
        times.push(ms);
        if ((done / block) % 5 === 0) overlaps.push([...score.overlap_of(made.poses())].map((meters) => meters * 1e3));
      }
    }
  }
  // A box that fell through would leave less overlap behind.
  const fallen = ({ made }) => made.poses().filter((_, k) => k % POSE === 1).filter((y, body) => scene.bodies[body].kind !== "fixed" && y < 0).length;
  const found = runs.map((run) => ({ times: run.times, overlaps: run.overlaps, fallen: fallen(run) }));
  runs.forEach(({ made }) => made.free());
  score.free();
  return found;
};

window.ready = Promise.all([start({ module_or_path: "drystone_web_bg.wasm" }), rapier.init(), simd.init()]).then(() => ({ rapier: rapier.version(), simd: simd.version() }));
