// begin_bodies: one thread clears the movement of one body since the step began.
// Writes bodies; no other thread writes the same one. Twin: BodyRow::AT_REST.

fn begin_body(i: u32) {
    bodies[i].dp = vec3f();
    bodies[i].dq = vec4f(0.0, 0.0, 0.0, 1.0);
}
