// The velocities of a body are no changes.

fn load_start(mass: Mass, body: u32) -> Free { return Free(vec3f(0.0), vec3f(0.0)); }
