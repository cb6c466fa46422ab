// Lines over the picture: contacts, joints, boxes. view/src/overlay.rs writes their ends.

struct LineFragment {
    @builtin(position) position: vec4f,
    @location(0) color: vec4f,
}

@vertex
fn end_of_line(@location(0) position: vec3f, @location(1) color: vec4f) -> LineFragment {
    return LineFragment(view.view_projection * vec4f(position, 1.0), color);
}

@fragment
fn paint_line(in: LineFragment) -> @location(0) vec4f {
    return vec4f(in.color.rgb, 1.0);
}
