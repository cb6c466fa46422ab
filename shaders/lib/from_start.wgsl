// Velocities of bodies are changes since the step began. This loads the velocities at that time. Twin: start_of in
// src/kernels/integrate.rs.

fn load_start(mass: Mass, body: u32) -> Free {
    return Free(select(vec3f(0.0), free[body].v, mass.inv_mass > 0.0), select(vec3f(0.0), free[body].w, mass.inv_mass > 0.0));
}
