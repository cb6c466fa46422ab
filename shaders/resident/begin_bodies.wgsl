// begin_bodies: one thread sets the movement of one body since the begin of the step to zero.
// Writes bodies; no other thread writes the same one. Its double is BodyRow::AT_REST.

fn begin_body(i: u32) {
    bodies[i].dp = vec3f();
    bodies[i].dq = vec4f(0.0, 0.0, 0.0, 1.0);
}
