// begin_bodies: one thread clears the movement of one body and the time since the step began.
// Writes bodies; no other thread writes the same one. Twin: BodyRow::AT_REST.

fn begin_body(i: u32) {
    bodies[i].dp = vec3f();
    bodies[i].time = 0.0;
    bodies[i].dq = vec4f(0.0, 0.0, 0.0, 1.0);
}
