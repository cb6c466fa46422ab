// Bodies as instanced meshes under one light with a shadow map, and a sky that is brighter above than below.
// One instance is one collider: view/src/mesh.rs writes its rows.

@group(0) @binding(1) var shadow_map: texture_depth_2d;
@group(0) @binding(2) var shadow_sampler: sampler_comparison;

// How many texels to either side the shadow map is compared at.
override SHADOW_REACH: i32 = 1;

const PLAIN = 0u;
const CHECKERED = 1u;
const OCTANTS = 2u;
const SENSOR = 3u;

struct Vertex {
    @location(0) position: vec3f,
    @location(1) normal: vec3f,
    @location(2) center: vec3f,
    @location(3) color: vec4f,
    @location(4) rotation: vec4f,
    @location(5) scale: vec3f,
    @location(6) pattern: u32,
}

struct Fragment {
    @builtin(position) position: vec4f,
    @location(0) world: vec3f,
    @location(1) normal: vec3f,
    @location(2) local: vec3f,
    @location(3) @interpolate(flat, either) color: vec4f,
    @location(4) @interpolate(flat, either) pattern: u32,
}

fn turned(q: vec4f, v: vec3f) -> vec3f {
    let t = 2.0 * cross(q.xyz, v);
    return v + q.w * t + cross(q.xyz, t);
}

fn placed(v: Vertex) -> vec3f {
    return v.center + turned(v.rotation, v.position * v.scale);
}

@vertex
fn cast_shadow(v: Vertex) -> @builtin(position) vec4f {
    if v.pattern == SENSOR {
        // Outside of the map.
        return vec4f(0.0, 0.0, 2.0, 1.0);
    }
    return view.light_projection * vec4f(placed(v), 1.0);
}

@vertex
fn transform(v: Vertex) -> Fragment {
    var out: Fragment;
    out.world = placed(v);
    out.position = view.view_projection * vec4f(out.world, 1.0);
    // A hidden part has no size, and its normal does not matter.
    out.normal = turned(v.rotation, v.normal / max(v.scale, vec3f(1e-12)));
    out.local = v.position;
    out.color = v.color;
    out.pattern = v.pattern;
    return out;
}

// Share of the light that reaches a point: the mean of comparisons around it.
fn lit(world: vec3f, normal: vec3f) -> f32 {
    // Off the surface by two texels, so that nothing shades itself.
    let moved = world + normal * (2.0 * view.light.w);
    let at = view.light_projection * vec4f(moved, 1.0);
    let uv = at.xy * vec2f(0.5, -0.5) + 0.5;
    let step = 1.0 / f32(textureDimensions(shadow_map).x);
    var sum = 0.0;
    for (var i = -SHADOW_REACH; i <= SHADOW_REACH; i++) {
        for (var k = -SHADOW_REACH; k <= SHADOW_REACH; k++) {
            let offset = vec2f(f32(i), f32(k)) * step;
            sum += textureSampleCompareLevel(shadow_map, shadow_sampler, uv + offset, at.z);
        }
    }
    // Beyond the map nothing is in the way.
    return select(sum / f32((2 * SHADOW_REACH + 1) * (2 * SHADOW_REACH + 1)), 1.0, any(uv < vec2f(0.0)) || any(uv > vec2f(1.0)));
}

// Faint squares on the ground, which show how far things are and how they move.
fn checker(world: vec3f) -> f32 {
    let across = normalize(select(vec3f(1.0, 0.0, 0.0), vec3f(0.0, 0.0, 1.0), abs(view.up.x) > 0.5));
    let x = across - view.up.xyz * dot(across, view.up.xyz);
    let z = cross(x, view.up.xyz);
    let cell = floor(vec2f(dot(world, x), dot(world, z)) / view.up.w);
    return select(1.0, 0.9, (i32(cell.x) + i32(cell.y)) % 2 == 0);
}

@fragment
fn shade(in: Fragment, @builtin(front_facing) front: bool) -> @location(0) vec4f {
    // One pixel of four, so that what is inside is seen.
    if in.pattern == SENSOR && any(vec2u(in.position.xy) % 2u != vec2u(0u)) {
        discard;
    }
    // Open surfaces are seen from both sides.
    let normal = normalize(in.normal) * select(-1.0, 1.0, front);
    var color = to_linear(in.color.rgb);
    if in.pattern == CHECKERED {
        color *= checker(in.world);
    } else if in.pattern == OCTANTS {
        color *= select(0.35, 1.0, in.local.x * in.local.y * in.local.z > 0.0);
    }
    let facing = max(dot(normal, view.light.xyz), 0.0);
    let sun = facing * lit(in.world, normal);
    let sky = mix(0.30, 0.55, 0.5 + 0.5 * dot(normal, view.up.xyz));
    let seen = color * (sky + 0.75 * sun);
    // The ground ends nowhere: it fades.
    let far = length(in.world - view.eye.xyz) / view.eye.w;
    let fade = select(0.0, smoothstep(1.0, 3.0, far), in.pattern == CHECKERED);
    return vec4f(mix(to_srgb(seen), view.background.rgb, fade), 1.0);
}
