// Bullet behind a few C functions: a world takes shapes, then bodies made of them, then ball joints.
//
// Everything is at the library's defaults, except that nothing sleeps or is damped, friction and restitution combine as in drystone,
// and margins of the shapes stay inside of them.

#include <btBulletDynamicsCommon.h>
#include <BulletDynamics/ConstraintSolver/btNNCGConstraintSolver.h>
#include <BulletDynamics/MLCPSolvers/btDantzigSolver.h>
#include <BulletDynamics/MLCPSolvers/btMLCPSolver.h>
#include <LinearMath/btConvexHullComputer.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <vector>

static_assert(sizeof(btScalar) == sizeof(float), "the library of single precision");

namespace {

// Restitution of a pair: the library multiplies, drystone takes the larger.
btScalar larger_restitution(const btCollisionObject *a, const btCollisionObject *b) {
    return std::max(a->getRestitution(), b->getRestitution());
}

// Share of the smallest half extent that a margin takes at most, as in the library's boxes and cylinders.
constexpr btScalar MARGIN_SHARE = 0.1f;

btVector3 vector(const float *v) { return btVector3(v[0], v[1], v[2]); }

// Position, then rotation as x, y, z, w.
btTransform transform(const float *p) { return btTransform(btQuaternion(p[3], p[4], p[5], p[6]), vector(p)); }

// The vertices and triangles that a mesh refers to.
struct Mesh {
    std::vector<btVector3> vertices;
    std::vector<int> indices;
    std::unique_ptr<btTriangleIndexVertexArray> triangles;
};

// A shape and where it lies in the frame that it was asked for in.
struct Placed {
    std::unique_ptr<btCollisionShape> shape;
    btTransform place;
};

} // namespace

struct World {
    btDefaultCollisionConfiguration config;
    btCollisionDispatcher dispatcher{&config};
    btDbvtBroadphase broadphase;
    btDantzigSolver dantzig;
    std::unique_ptr<btConstraintSolver> solver;
    std::unique_ptr<btDiscreteDynamicsWorld> dynamics;
    std::vector<std::unique_ptr<Mesh>> meshes;
    std::vector<Placed> shapes;
    std::vector<std::unique_ptr<btCompoundShape>> compounds;
    std::vector<std::unique_ptr<btRigidBody>> bodies;
    std::vector<std::unique_ptr<btTypedConstraint>> joints;

    int keep(btCollisionShape *shape, const btTransform &place = btTransform::getIdentity()) {
        shapes.push_back({std::unique_ptr<btCollisionShape>(shape), place});
        return int(shapes.size()) - 1;
    }
};

extern "C" {

// Solvers: 0 sequential impulses, 1 a nonlinear conjugate gradient over them, 2 Dantzig's pivots.
World *bullet_world(const float *gravity, int solver, int iterations) {
    gCalculateCombinedRestitutionCallback = larger_restitution;
    auto world = std::make_unique<World>();
    switch (solver) {
    case 1:
        world->solver = std::make_unique<btNNCGConstraintSolver>();
        break;
    case 2:
        world->solver = std::make_unique<btMLCPSolver>(&world->dantzig);
        break;
    default:
        world->solver = std::make_unique<btSequentialImpulseConstraintSolver>();
    }
    world->dynamics = std::make_unique<btDiscreteDynamicsWorld>(&world->dispatcher, &world->broadphase, world->solver.get(), &world->config);
    world->dynamics->setGravity(vector(gravity));
    world->dynamics->getSolverInfo().m_numIterations = iterations;
    return world.release();
}

void bullet_free(World *world) {
    for (auto &joint : world->joints) world->dynamics->removeConstraint(joint.get());
    for (auto &body : world->bodies) world->dynamics->removeRigidBody(body.get());
    delete world;
}

// The functions that make a shape give its number in the world, or -1.

int bullet_ball(World *world, float radius) { return world->keep(new btSphereShape(radius)); }

int bullet_box(World *world, const float *half) { return world->keep(new btBoxShape(vector(half))); }

// Along Y, as cylinder and cone.
int bullet_capsule(World *world, float radius, float half_height) {
    return world->keep(new btCapsuleShape(radius, 2 * half_height));
}

int bullet_cylinder(World *world, float radius, float half_height) {
    return world->keep(new btCylinderShape(btVector3(radius, half_height, radius)));
}

// The library adds the margin around a cone, so that a smaller one is given to it, whose faces are a margin further in.
int bullet_cone(World *world, float radius, float half_height) {
    const btScalar height = 2 * half_height, slant = std::sqrt(radius * radius + height * height);
    const btScalar margin = std::min(CONVEX_DISTANCE_MARGIN, MARGIN_SHARE * std::min(radius, half_height));
    const btScalar inner = height - margin - margin * slant / radius;
    auto cone = new btConeShape(radius * inner / height, inner);
    cone->setMargin(margin);
    btTransform place = btTransform::getIdentity();
    place.setOrigin(btVector3(0, margin - half_height + inner / 2, 0));
    return world->keep(cone, place);
}

// As the cone: its faces move in by the margin that the library adds.
int bullet_hull(World *world, const float *points, int count) {
    btConvexHullComputer hull;
    // The distance of a face from the middle, at most a tenth of which is shrunken away.
    const btScalar margin = hull.compute(points, 3 * sizeof(float), count, CONVEX_DISTANCE_MARGIN, MARGIN_SHARE);
    if (margin < 0 || hull.vertices.size() < 4) return -1;
    auto shape = new btConvexHullShape(&hull.vertices[0].getX(), hull.vertices.size(), sizeof(btVector3));
    shape->setMargin(margin);
    return world->keep(shape);
}

int bullet_half_space(World *world, const float *normal) { return world->keep(new btStaticPlaneShape(vector(normal), 0)); }

int bullet_mesh(World *world, const float *vertices, int vertex_count, const uint32_t *indices, int triangle_count) {
    auto mesh = std::make_unique<Mesh>();
    for (int i = 0; i < vertex_count; i++) mesh->vertices.push_back(vector(vertices + 3 * i));
    mesh->indices.assign(indices, indices + 3 * triangle_count);
    mesh->triangles = std::make_unique<btTriangleIndexVertexArray>(
        triangle_count, mesh->indices.data(), int(3 * sizeof(int)), vertex_count, &mesh->vertices[0].m_floats[0], int(sizeof(btVector3)));
    auto shape = new btBvhTriangleMeshShape(mesh->triangles.get(), true);
    // Around a surface a margin would lift what lies on it.
    shape->setMargin(0);
    world->meshes.push_back(std::move(mesh));
    return world->keep(shape);
}

// A body of `count` shapes, whose places are in its frame, in which the inertia is diagonal about the origin. A mass of 0 is a fixed body.
// Friction of a pair is a product, so that the root of each gives the geometric mean.
void bullet_body(World *world, const float *pose, float mass, const float *inertia, const float *velocity, float friction, float restitution,
                 int is_kinematic, int count, const int *shapes, const float *places) {
    btCollisionShape *shape = nullptr;
    const auto place = [&](int k) { return transform(places + 7 * k) * world->shapes[shapes[k]].place; };
    if (count == 1 && place(0) == btTransform::getIdentity()) {
        shape = world->shapes[shapes[0]].shape.get();
    } else {
        auto compound = std::make_unique<btCompoundShape>();
        for (int k = 0; k < count; k++) compound->addChildShape(place(k), world->shapes[shapes[k]].shape.get());
        shape = compound.get();
        world->compounds.push_back(std::move(compound));
    }
    btRigidBody::btRigidBodyConstructionInfo info(mass, nullptr, shape, vector(inertia));
    info.m_startWorldTransform = transform(pose);
    info.m_friction = std::sqrt(friction);
    info.m_restitution = restitution;
    info.m_linearDamping = info.m_angularDamping = 0;
    auto body = std::make_unique<btRigidBody>(info);
    if (is_kinematic) body->setCollisionFlags(body->getCollisionFlags() | btCollisionObject::CF_KINEMATIC_OBJECT);
    body->setActivationState(DISABLE_DEACTIVATION);
    body->setLinearVelocity(vector(velocity));
    body->setAngularVelocity(vector(velocity + 3));
    world->dynamics->addRigidBody(body.get());
    world->bodies.push_back(std::move(body));
}

// A ball joint; with b < 0 to the place `at_b` of the world.
void bullet_joint(World *world, int a, const float *at_a, int b, const float *at_b, int collide) {
    btRigidBody &body = *world->bodies[a];
    auto other = b < 0 ? &btTypedConstraint::getFixedBody() : world->bodies[b].get();
    auto joint = std::make_unique<btPoint2PointConstraint>(body, *other, vector(at_a), vector(at_b));
    world->dynamics->addConstraint(joint.get(), !collide);
    world->joints.push_back(std::move(joint));
}

void bullet_force(World *world, int body, const float *force) { world->bodies[body]->applyCentralForce(vector(force)); }

// Where a kinematic body is at the end of the next step.
void bullet_target(World *world, int body, const float *pose) { world->bodies[body]->setWorldTransform(transform(pose)); }

void bullet_step(World *world, float dt) { world->dynamics->stepSimulation(dt, 0); }

// Position, rotation, linear and angular velocity.
void bullet_state(const World *world, int index, float *out) {
    const btRigidBody &body = *world->bodies[index];
    const btTransform &at = body.getWorldTransform();
    const btQuaternion turn = at.getRotation();
    const btVector3 &p = at.getOrigin(), &v = body.getLinearVelocity(), &w = body.getAngularVelocity();
    const btScalar all[13] = {p.x(), p.y(), p.z(), turn.x(), turn.y(), turn.z(), turn.w(), v.x(), v.y(), v.z(), w.x(), w.y(), w.z()};
    std::copy(all, all + 13, out);
}

} // extern "C"
