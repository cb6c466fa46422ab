// What every picture shader reads, and how colors leave it. view/src/renderer.rs writes the uniforms.

struct View {
    view_projection: mat4x4f,
    light_projection: mat4x4f,
    // Eye of the camera; w is the distance at which the ground begins to fade into the background.
    eye: vec4f,
    // Unit vector to the light; w is the side of a texel of the shadow map on the scene [m].
    light: vec4f,
    // Unit vector up; w is the edge of the ground's pattern [m].
    up: vec4f,
    background: vec4f,
}

@group(0) @binding(0) var<uniform> view: View;

// Colors come and go as sRGB; light adds up in between.
fn to_linear(c: vec3f) -> vec3f {
    return pow(c, vec3f(2.2));
}

fn to_srgb(c: vec3f) -> vec3f {
    return pow(c, vec3f(1.0 / 2.2));
}
