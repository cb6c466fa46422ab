// Angles of the frames of a joint. Twins: src/math/angles.rs.

// Coordinates of a rotation of frame a in frame b, and the directions whose products with the spin of a against b, in
// frame b, are their rates: the twist, two components of the swing, twice those of the quaternion, and two heights.
struct Angles { values: array<f32, 8>, directions: array<vec3f, 8> }

// Least squared cosine of half a swing, and least cosine of half a twist.
const MIN_COSINE: f32 = 1e-8;
// The largest squared tangent of half a swing with a direction of the twist across the first axis.
const MAX_TANGENT_SQUARE: f32 = 2e3;
// The smallest value of s cot(s).
const MIN_COTANGENT: f32 = -30.0;
// Below this square of a swing (rad^2), (1 - s cot(s))/s^2 is 1/3.
const SMALL_SWING: f32 = 1e-6;

fn angles_of(q: vec4f) -> Angles {
    let sign = select(1.0, -1.0, 0.0 > q.w);
    let tangent = q.x * sign * reciprocal(larger(q.w * sign, MIN_COSINE));
    let twist = tangent * arc_over_tangent(tangent * tangent) * 2.0;

    // n tan(s/2), where q is a swing after a twist.
    let across_y = q.w * q.y - q.x * q.z;
    let across_z = q.w * q.z + q.x * q.y;
    let per_cosine = reciprocal(larger(q.w * q.w + q.x * q.x, MIN_COSINE));
    let t_y = across_y * per_cosine;
    let t_z = across_z * per_cosine;
    let square = t_y * t_y + t_z * t_z;
    let per_tangent = arc_over_tangent(square) * 2.0;
    let a = t_y * per_tangent;
    let b = t_z * per_tangent;
    let across = larger(per_tangent * (1.0 - square) * 0.5, MIN_COTANGENT);
    let squared_angle = a * a + b * b;
    let curved = (1.0 - across) * reciprocal(squared_angle);
    let bend = select(1.0 / 3.0, curved, squared_angle > SMALL_SWING);
    let has_twist = MAX_TANGENT_SQUARE > square;

    // The first axis of a, in frame b.
    let first = vec3f(1.0 - (q.y * q.y + q.z * q.z) * 2.0, across_z * 2.0, -(across_y * 2.0));
    return Angles(
        array<f32, 8>(twist, a, b, q.x * 2.0, q.y * 2.0, q.z * 2.0, across_y * 2.0, across_z * 2.0),
        array<vec3f, 8>(
            vec3f(1.0, select(0.0, t_z, has_twist), select(0.0, -t_y, has_twist)),
            vec3f(-b, across + a * a * bend, a * b * bend),
            vec3f(a, a * b * bend, across + b * b * bend),
            vec3f(q.w, q.z, -q.y),
            vec3f(-q.z, q.w, q.x),
            vec3f(q.y, -q.x, q.w),
            vec3f(-first.y, first.x, 0.0),
            vec3f(-first.z, 0.0, first.x),
        ),
    );
}

struct Elevation { value: f32, direction: vec3f }

// The angle of a height, and the direction of its rate, from the direction of the height. At a pole the direction is
// `axis`.
fn elevation(height: f32, direction: vec3f, axis: vec3f) -> Elevation {
    // The direction of a height is as long as the cosine of its angle.
    let square = dot3(direction, direction);
    let inverse = inverse_sqrt(larger(square, MIN_COSINE));
    let tangent = height * inverse;
    let value = tangent * arc_over_tangent(tangent * tangent);
    return Elevation(value, select(axis, direction * inverse, square > MIN_COSINE));
}

// atan(t)/t from the square of t.
fn arc_over_tangent(square: f32) -> f32 {
    let inverse = inverse_sqrt(square);
    let is_steep = square > 1.0;
    let v = select(square, inverse * inverse, is_steep);
    var sum = -6.343974e-3;
    sum = sum * v + 2.9852263e-2;
    sum = sum * v + -6.6890806e-2;
    sum = sum * v + 0.10394262;
    sum = sum * v + -0.1417643;
    sum = sum * v + 0.19993468;
    sum = sum * v + -0.33333267;
    let arc = sum * v + 1.0;
    return select(arc, (1.5707964 - inverse * arc) * inverse, is_steep);
}
