// Velocities of bodies are not changes. There is nothing to add to them.

fn load_start(mass: Mass, body: u32) -> Free { return Free(vec3f(0.0), vec3f(0.0)); }
