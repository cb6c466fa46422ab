//! Draws the bodies of a world with wgpu on any adapter: an instanced draw for each mesh, a shadow map, and lines on
//! top.

use bytemuck::{Pod, Zeroable};
use glam::Vec3;
use glam::camera::rh::proj::directx;
use glam::camera::rh::view::look_at_mat4;

use crate::bounds::Bounds;
use crate::camera::Camera;
use crate::colors::{FIXED, Rgba};
use crate::mesh::{Ground, Instance, Meshes, Vertex};
use crate::overlay::LineEnd;
use crate::pipeline::{DEPTH, Drawing, Quality, bind, cleared_depth, layout_of, pipeline, texture};
use crate::poses::Poses;
use drystone::{BodyHandle, World};

/// The colors of the background and of fixed bodies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shades {
    /// Behind all bodies; the ground fades into it (sRGB, 0 to 1).
    pub background: [f32; 3],
    /// The ground: fixed half-spaces.
    pub ground: Rgba,
    /// Other fixed bodies.
    pub fixed: Rgba,
}

impl Shades {
    /// Dark bodies in front of a light background.
    pub const LIGHT: Self = Self { background: [0.93, 0.94, 0.96], ground: FIXED, fixed: FIXED };
    /// Light bodies in front of a dark background.
    pub const DARK: Self =
        Self { background: [0.075, 0.085, 0.105], ground: [62, 66, 74, 255], fixed: [92, 97, 107, 255] };

    /// A background color of the caller, with the ground of the light or the dark shades.
    pub fn before(background: [f32; 3]) -> Self {
        let is_dark = background.iter().sum::<f32>() < 1.5;
        Self { background, ..if is_dark { Self::DARK } else { Self::LIGHT } }
    }
}

#[derive(Clone, Copy)]
pub struct Shot<'a> {
    pub poses: &'a Poses,
    pub colors: &'a [Rgba],
    pub camera: &'a Camera,
    pub bounds: Bounds,
    /// The near walls of this space are hidden.
    pub container: Option<Bounds>,
    pub lines: &'a [LineEnd],
}

/// Twin of `View` in shaders/view.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct View {
    view_projection: [[f32; 4]; 4],
    light_projection: [[f32; 4]; 4],
    eye: [f32; 4],
    light: [f32; 4],
    up: [f32; 4],
    background: [f32; 4],
}

/// Draws the bodies of a world.
pub struct Renderer {
    pub shades: Shades,
    device: wgpu::Device,
    queue: wgpu::Queue,
    meshes: Meshes,
    /// The bodies of the present meshes.
    drawn: Vec<BodyHandle>,
    vertices: wgpu::Buffer,
    view: wgpu::Buffer,
    shadow_map: wgpu::TextureView,
    shadow_group: wgpu::BindGroup,
    main_group: wgpu::BindGroup,
    shadow: wgpu::RenderPipeline,
    bodies: wgpu::RenderPipeline,
    lines: wgpu::RenderPipeline,
    format: wgpu::TextureFormat,
    quality: Quality,
    /// Textures with the size of the picture: depth, and color with several samples.
    targets: Option<Targets>,
}

struct Targets {
    size: (u32, u32),
    color: Option<wgpu::TextureView>,
    depth: wgpu::TextureView,
}

impl Renderer {
    /// A renderer for the bodies of `world` into textures of `format`, which must not be an sRGB format.
    pub fn new(
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        format: wgpu::TextureFormat,
        quality: Quality,
        world: &World,
    ) -> Self {
        let meshes = Meshes::new(world);
        let vertices = vertex_buffer(device, queue, bytemuck::cast_slice(&meshes.vertices));
        let view = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("view"),
            size: size_of::<View>() as u64,
            usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let usage = wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::TEXTURE_BINDING;
        let shadow_map = texture(device, (quality.shadow_size, quality.shadow_size), DEPTH, 1, usage)
            .create_view(&Default::default());
        let sampler = device.create_sampler(&wgpu::SamplerDescriptor {
            label: Some("shadow"),
            mag_filter: wgpu::FilterMode::Linear,
            min_filter: wgpu::FilterMode::Linear,
            compare: Some(wgpu::CompareFunction::LessEqual),
            ..Default::default()
        });

        let ty = wgpu::BufferBindingType::Uniform;
        let uniform = wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None };
        let (sample_type, view_dimension) = (wgpu::TextureSampleType::Depth, wgpu::TextureViewDimension::D2);
        let depth_texture = wgpu::BindingType::Texture { sample_type, view_dimension, multisampled: false };
        let comparison = wgpu::BindingType::Sampler(wgpu::SamplerBindingType::Comparison);
        let resources = [
            view.as_entire_binding(),
            wgpu::BindingResource::TextureView(&shadow_map),
            wgpu::BindingResource::Sampler(&sampler),
        ];
        // The shadow pass writes the map and must not bind it.
        let (shadow_layout, shadow_group) = bind(device, &[uniform], &resources[..1]);
        let (main_layout, main_group) = bind(device, &[uniform, depth_texture, comparison], &resources);

        let module = |label: &str, source: &str| {
            device.create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some(label),
                source: wgpu::ShaderSource::Wgsl([include_str!("../shaders/view.wgsl"), source].concat().into()),
            })
        };
        let mesh = module("mesh", include_str!("../shaders/mesh.wgsl"));
        let line = module("line", include_str!("../shaders/line.wgsl"));
        let corner = wgpu::vertex_attr_array![0 => Float32x3, 1 => Float32x3];
        let row = wgpu::vertex_attr_array![2 => Float32x3, 3 => Unorm8x4, 4 => Float32x4, 5 => Float32x3, 6 => Uint32];
        let end = wgpu::vertex_attr_array![0 => Float32x3, 1 => Unorm8x4];
        let rows = [
            layout_of::<Vertex>(wgpu::VertexStepMode::Vertex, &corner),
            layout_of::<Instance>(wgpu::VertexStepMode::Instance, &row),
        ];
        let ends = [layout_of::<LineEnd>(wgpu::VertexStepMode::Vertex, &end)];
        let make = |layout, module, vertex, fragment, buffers, topology, depth| {
            pipeline(device, &Drawing { layout, module, vertex, fragment, buffers, topology, depth, format, quality })
        };
        use wgpu::CompareFunction::{Always, Less};
        use wgpu::PrimitiveTopology::{LineList, TriangleList};
        Self {
            shadow: make(&shadow_layout, &mesh, "cast_shadow", None, &rows, TriangleList, Less),
            bodies: make(&main_layout, &mesh, "transform", Some("shade"), &rows, TriangleList, Less),
            // Contacts lie inside bodies; lines are drawn on top.
            lines: make(&shadow_layout, &line, "end_of_line", Some("paint_line"), &ends, LineList, Always),
            shades: Shades::LIGHT,
            device: device.clone(),
            queue: queue.clone(),
            meshes,
            drawn: world.bodies.handles().collect(),
            vertices,
            view,
            shadow_map,
            shadow_group,
            main_group,
            format,
            quality,
            targets: None,
        }
    }

    /// Updates the meshes after bodies were added or removed since the last picture.
    pub fn follow(&mut self, world: &World) {
        if !world.bodies.handles().eq(self.drawn.iter().copied()) {
            self.replace(world);
        }
    }

    /// Replaces the meshes, for another world or after shapes changed.
    pub fn replace(&mut self, world: &World) {
        self.meshes = Meshes::new(world);
        self.drawn = world.bodies.handles().collect();
        self.vertices = vertex_buffer(&self.device, &self.queue, bytemuck::cast_slice(&self.meshes.vertices));
    }

    /// Draws `shot` into `target` of width and height `size` (pixels).
    pub fn draw(&mut self, target: &wgpu::TextureView, size: (u32, u32), shot: &Shot) {
        self.write_view(shot, size.0 as f32 / size.1 as f32);
        let eye = shot.camera.eye();
        let container = shot.container.filter(|c| c.low.is_finite() && c.high.is_finite());
        let hidden = |b: &Bounds| container.is_some_and(|c| stands_before(b, &c, eye));
        let (middle, reach) = (shot.bounds.center(), 40.0 * shot.bounds.radius().max(shot.camera.distance));
        let Shades { ground: color, fixed, .. } = self.shades;
        let ground = Ground { middle, reach, color, fixed };
        let instances = self.meshes.instances(shot.poses, shot.colors, &ground, hidden);
        let (device, queue) = (&self.device, &self.queue);
        let rows = vertex_buffer(device, queue, bytemuck::cast_slice(&instances));
        let ends = vertex_buffer(device, queue, bytemuck::cast_slice(shot.lines));

        if self.targets.as_ref().is_none_or(|t| t.size != size) {
            let samples = self.quality.samples;
            let usage = wgpu::TextureUsages::RENDER_ATTACHMENT;
            let of = |format| texture(&self.device, size, format, samples, usage).create_view(&Default::default());
            self.targets = Some(Targets { size, color: (samples > 1).then(|| of(self.format)), depth: of(DEPTH) });
        }
        let Some(Targets { color, depth, .. }) = &self.targets else { return };
        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let draw_bodies = |pass: &mut wgpu::RenderPass, pipeline, group| {
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, group, &[]);
            pass.set_vertex_buffer(0, self.vertices.slice(..));
            pass.set_vertex_buffer(1, rows.slice(..));
            self.meshes.draws().for_each(|(vertices, instances)| pass.draw(vertices, instances));
        };
        {
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("shadow"),
                depth_stencil_attachment: Some(cleared_depth(&self.shadow_map, wgpu::StoreOp::Store)),
                ..Default::default()
            });
            draw_bodies(&mut pass, &self.shadow, &self.shadow_group);
        }
        let [r, g, b] = self.shades.background.map(f64::from);
        let attachment = wgpu::RenderPassColorAttachment {
            view: color.as_ref().unwrap_or(target),
            depth_slice: None,
            resolve_target: color.as_ref().map(|_| target),
            ops: wgpu::Operations {
                load: wgpu::LoadOp::Clear(wgpu::Color { r, g, b, a: 1.0 }),
                store: if color.is_some() { wgpu::StoreOp::Discard } else { wgpu::StoreOp::Store },
            },
        };
        {
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("bodies"),
                color_attachments: &[Some(attachment)],
                depth_stencil_attachment: Some(cleared_depth(depth, wgpu::StoreOp::Discard)),
                ..Default::default()
            });
            draw_bodies(&mut pass, &self.bodies, &self.main_group);
            // A browser warns about an empty draw.
            if !shot.lines.is_empty() {
                pass.set_pipeline(&self.lines);
                pass.set_bind_group(0, &self.shadow_group, &[]);
                pass.set_vertex_buffer(0, ends.slice(..));
                pass.draw(0..shot.lines.len() as u32, 0..1);
            }
        }
        self.queue.submit([encoder.finish()]);
    }

    fn write_view(&self, shot: &Shot, aspect: f32) {
        let (camera, bounds) = (shot.camera, shot.bounds);
        let (center, radius) = (bounds.center(), bounds.radius());
        // The light comes from the left behind the camera, so that visible sides differ in brightness.
        let [right, _, back] = camera.axes();
        let level = |v: Vec3| (v - camera.up * v.dot(camera.up)).normalize_or_zero();
        let light = (camera.up + 0.35 * level(back) - 0.55 * level(right)).normalize();
        let from = look_at_mat4(center + 3.0 * radius * light, center, camera.axes()[1]);
        let around = directx::orthographic(-radius, radius, -radius, radius, radius, 5.0 * radius);
        let view = View {
            view_projection: camera.projection(aspect, radius).to_cols_array_2d(),
            light_projection: (around * from).to_cols_array_2d(),
            eye: camera.eye().extend(camera.distance + 2.0 * radius).to_array(),
            light: light.extend(2.0 * radius / self.quality.shadow_size as f32).to_array(),
            // The side of the squares on the ground is a power of ten (m).
            up: camera.up.extend(10.0_f32.powf((radius.log10() - 0.5).round())).to_array(),
            background: Vec3::from_array(self.shades.background).extend(1.0).to_array(),
        };
        self.queue.write_buffer(&self.view, 0, bytemuck::bytes_of(&view));
    }
}

/// Whether a body is a near wall of `container`: it lies outside, on the side of the eye, and covers more than half of
/// both lengths of this side.
fn stands_before(b: &Bounds, container: &Bounds, eye: Vec3) -> bool {
    let slack = 1e-3 * container.radius();
    let covered = b.high.min(container.high) - b.low.max(container.low);
    let is_wide = |k: usize| covered[k] > 0.5 * (container.high[k] - container.low[k]);
    (0..3).any(|k| {
        let above = eye[k] > container.high[k] && b.low[k] > container.high[k] - slack;
        let below = eye[k] < container.low[k] && b.high[k] < container.low[k] + slack;
        (above || below) && is_wide((k + 1) % 3) && is_wide((k + 2) % 3)
    })
}

/// A buffer of vertices or instances. It is not mapped at creation: in a browser that fails if the device is lost.
fn vertex_buffer(device: &wgpu::Device, queue: &wgpu::Queue, contents: &[u8]) -> wgpu::Buffer {
    let buffer = device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("vertices"),
        size: contents.len().max(64) as u64,
        usage: wgpu::BufferUsages::VERTEX | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    queue.write_buffer(&buffer, 0, contents);
    buffer
}
