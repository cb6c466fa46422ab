//! An open window: its surface, its camera, its panel.

use std::sync::Arc;
use std::time::Instant;

use egui::ViewportId;
use glam::Vec2;
use winit::dpi::{LogicalSize, PhysicalPosition};
use winit::event::MouseButton;
use winit::event_loop::ActiveEventLoop;
use winit::window::Window;

use super::panel::Panel;
use drystone::backend::gpu::open_for_surface;
use drystone::{Error, Result};
use drystone_view::{Camera, Key, Pointer, Quality, Renderer, Shot, poses};

pub(super) fn no_display() -> Error {
    let without =
        "`drystone render SCENE --out FILE.png` and `drystone play maze --script FILE --out FILE.gif` draw without one";
    Error::Adapter(format!("no display to open a window on; {without}"))
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Drag {
    Nothing,
    Body,
    Orbit,
    Pan,
}

pub(super) struct Open {
    pub(super) window: Arc<Window>,
    device: wgpu::Device,
    queue: wgpu::Queue,
    surface: wgpu::Surface<'static>,
    surface_config: wgpu::SurfaceConfiguration,
    renderer: Renderer,
    pub(super) camera: Camera,
    pub(super) ui: egui_winit::State,
    ui_renderer: egui_wgpu::Renderer,
    panel: bool,
    /// Width of the panel at the right of the window (pixels).
    panel_width: f32,
    drag: Drag,
    mouse: PhysicalPosition<f64>,
    last: Instant,
}

impl Open {
    pub(super) fn new(events: &ActiveEventLoop, show: &dyn Panel) -> Result<Self> {
        let attributes =
            Window::default_attributes().with_title(show.title()).with_inner_size(LogicalSize::new(1100.0, 720.0));
        let window = Arc::new(events.create_window(attributes).map_err(|_| no_display())?);
        let size = window.inner_size();
        let display = Box::new(events.owned_display_handle());
        let (surface, adapter, device, queue) = open_for_surface(display, window.clone())?;
        let mut surface_config = surface
            .get_default_config(&adapter, size.width.max(1), size.height.max(1))
            .ok_or_else(|| Error::Adapter("the adapter cannot draw on this display".into()))?;
        // The shaders and egui encode sRGB themselves.
        let formats = surface.get_capabilities(&adapter).formats;
        surface_config.format = formats.into_iter().find(|f| !f.is_srgb()).unwrap_or(surface_config.format);
        surface.configure(&device, &surface_config);

        let hardware = adapter.get_info().device_type != wgpu::DeviceType::Cpu;
        let quality = if hardware { Quality::FINE } else { Quality::FAST };
        let renderer = Renderer::new(&device, &queue, surface_config.format, quality, show.world());
        let context = egui::Context::default();
        let scale = window.scale_factor() as f32;
        let most = device.limits().max_texture_dimension_2d as usize;
        let ui = egui_winit::State::new(context, ViewportId::ROOT, events, Some(scale), None, Some(most));
        let ui_renderer =
            egui_wgpu::Renderer::new(&device, surface_config.format, egui_wgpu::RendererOptions::default());
        Ok(Self {
            camera: show.camera(size.width.max(1) as f32 / size.height.max(1) as f32),
            window,
            device,
            queue,
            surface,
            surface_config,
            renderer,
            ui,
            ui_renderer,
            panel: true,
            panel_width: 0.0,
            drag: Drag::Nothing,
            mouse: PhysicalPosition::default(),
            last: Instant::now(),
        })
    }

    fn aspect(&self) -> f32 {
        self.surface_config.width as f32 / self.surface_config.height as f32
    }

    /// Returns whether the window still exists.
    pub(super) fn resize(&mut self, width: u32, height: u32) -> bool {
        if width == 0 || height == 0 {
            return true;
        }
        (self.surface_config.width, self.surface_config.height) = (width, height);
        self.configure()
    }

    /// Resizes the surface; returns whether the window still exists, since another program may close it.
    fn configure(&self) -> bool {
        let refused = self.device.push_error_scope(wgpu::ErrorFilter::Validation);
        self.surface.configure(&self.device, &self.surface_config);
        pollster::block_on(refused.pop()).is_none()
    }

    /// Sets the camera of `show` for the part of the window beside the panel.
    fn frame_scene(&mut self, show: &dyn Panel) {
        let (width, height) = (self.surface_config.width as f32, self.surface_config.height as f32);
        // The panel counts for at most half of the window.
        let panel = if self.panel { self.panel_width.min(0.5 * width) } else { 0.0 };
        self.camera = show.camera((width - panel) / height);
        self.camera.pan(Vec2::new(-0.5 * panel / height, 0.0));
    }

    pub(super) fn key(&mut self, key: Key, down: bool, show: &mut dyn Panel) {
        show.point(&self.pointer());
        match key {
            Key::Character('f') if down => self.frame_scene(show),
            Key::Character('h') if down => self.panel = !self.panel,
            _ => {}
        }
    }

    fn pointer(&self) -> Pointer {
        let size = Vec2::new(self.surface_config.width as f32, self.surface_config.height as f32);
        let at = Vec2::new(self.mouse.x as f32, self.mouse.y as f32) / size * 2.0 - 1.0;
        let at = at * Vec2::new(1.0, -1.0);
        let (origin, direction) = self.camera.ray(at, self.aspect());
        Pointer { at, origin, direction }
    }

    pub(super) fn button(&mut self, button: MouseButton, down: bool, show: &mut dyn Panel) {
        if !down && self.drag == Drag::Body {
            show.release();
        }
        self.drag = match (button, down) {
            (MouseButton::Left, true) if show.grab(&self.pointer()) => Drag::Body,
            (MouseButton::Left | MouseButton::Right, true) => Drag::Orbit,
            (MouseButton::Middle, true) => Drag::Pan,
            _ => Drag::Nothing,
        };
    }

    pub(super) fn moved(&mut self, to: PhysicalPosition<f64>, show: &mut dyn Panel) {
        let by = Vec2::new((to.x - self.mouse.x) as f32, (to.y - self.mouse.y) as f32);
        let by = by / self.surface_config.height as f32;
        self.mouse = to;
        match self.drag {
            Drag::Body => show.drag(&self.pointer()),
            Drag::Orbit => self.camera.orbit(by),
            Drag::Pan => self.camera.pan(by),
            Drag::Nothing => {}
        }
    }

    /// Advances the time and draws; returns whether the window still exists.
    pub(super) fn frame(&mut self, show: &mut dyn Panel) -> Result<bool> {
        let now = Instant::now();
        show.advance((now - self.last).as_secs_f32())?;
        self.last = now;
        if self.drag == Drag::Body {
            // The camera and the body can move while the mouse does not.
            show.drag(&self.pointer());
        }

        use wgpu::CurrentSurfaceTexture::{Lost, Outdated, Suboptimal, Success};
        let target = match self.surface.get_current_texture() {
            Success(target) | Suboptimal(target) => target,
            Outdated | Lost => return Ok(self.configure()),
            // The window is hidden or late; the next frame may succeed.
            _ => return Ok(true),
        };
        let view = target.texture.create_view(&wgpu::TextureViewDescriptor::default());
        let (colors, lines) = (show.colors(), show.lines());
        let poses = poses(show.world());
        let shot = Shot {
            poses: &poses,
            colors: &colors,
            camera: &self.camera,
            bounds: show.bounds(),
            container: show.container(),
            lines: &lines,
        };
        let size = (self.surface_config.width, self.surface_config.height);
        self.renderer.follow(show.world());
        self.renderer.draw(&view, size, &shot);
        self.draw_panel(&view, show);
        self.window.pre_present_notify();
        self.queue.present(target);
        Ok(true)
    }

    fn draw_panel(&mut self, view: &wgpu::TextureView, show: &mut dyn Panel) {
        let context = self.ui.egui_ctx().clone();
        let input = self.ui.take_egui_input(&self.window);
        let panel = self.panel;
        let mut width = 0.0;
        let mut output = context.run_ui(input, |ui| {
            if panel {
                let corner = ui.ctx().content_rect().right_top() + egui::vec2(-8.0, 8.0);
                let window = egui::Window::new(show.title()).pivot(egui::Align2::RIGHT_TOP).default_pos(corner);
                // A panel that is higher than the window scrolls.
                let most = ui.ctx().content_rect().height() - 64.0;
                let shown = window.resizable(false).vscroll(true).max_height(most).show(ui.ctx(), |ui| show.panel(ui));
                width = shown.map_or(0.0, |s| s.response.rect.width() * ui.ctx().pixels_per_point());
            }
        });
        // The first frame gives the width of the panel.
        if width > 0.0 && std::mem::replace(&mut self.panel_width, width) == 0.0 {
            self.frame_scene(show);
        }
        self.ui.handle_platform_output(&self.window, output.platform_output);
        let triangles = context.tessellate(output.shapes, output.pixels_per_point);
        let screen = egui_wgpu::ScreenDescriptor {
            size_in_pixels: [self.surface_config.width, self.surface_config.height],
            pixels_per_point: output.pixels_per_point,
        };
        for (id, deltas) in &output.textures_delta.set {
            deltas.iter().for_each(|d| self.ui_renderer.update_texture(&self.device, &self.queue, *id, d));
        }
        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        self.ui_renderer.update_buffers(&self.device, &self.queue, &mut encoder, &triangles, &screen);
        {
            let attachment = wgpu::RenderPassColorAttachment {
                view,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations { load: wgpu::LoadOp::Load, store: wgpu::StoreOp::Store },
            };
            let pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("panel"),
                color_attachments: &[Some(attachment)],
                ..Default::default()
            });
            self.ui_renderer.render(&mut pass.forget_lifetime(), &triangles, &screen);
        }
        self.queue.submit([encoder.finish()]);
        for id in &output.textures_delta.free {
            self.ui_renderer.free_texture(id);
        }
        // egui panics if this is dropped with contents.
        output.textures_delta.clear();
    }
}
