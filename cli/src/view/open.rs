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
use drystone::{Error, Result};
use drystone_view::{Eye, Key, Next, Pointer, Sight};

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
    sight: Sight,
    pub(super) eye: Eye,
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
        let sight = Sight::on_window(display, window.clone(), (size.width, size.height))?;
        let context = egui::Context::default();
        let scale = window.scale_factor() as f32;
        let most = sight.device().limits().max_texture_dimension_2d as usize;
        let ui = egui_winit::State::new(context, ViewportId::ROOT, events, Some(scale), None, Some(most));
        let ui_renderer =
            egui_wgpu::Renderer::new(sight.device(), sight.format(), egui_wgpu::RendererOptions::default());
        Ok(Self {
            eye: Eye::new(show, sight.aspect()),
            window,
            sight,
            ui,
            ui_renderer,
            panel: true,
            panel_width: 0.0,
            drag: Drag::Nothing,
            mouse: PhysicalPosition::default(),
            last: Instant::now(),
        })
    }

    /// Returns whether the window still exists.
    pub(super) fn resize(&mut self, width: u32, height: u32) -> bool {
        width == 0 || height == 0 || self.sight.resize((width, height))
    }

    fn size(&self) -> Vec2 {
        let (width, height) = self.sight.size();
        Vec2::new(width as f32, height as f32)
    }

    /// Frames the moving bodies in the part of the window beside the panel.
    fn follow(&mut self, show: &dyn Panel) {
        let [width, height] = self.size().to_array();
        // The panel counts for at most half of the window.
        let panel = if self.panel { self.panel_width.min(0.5 * width) } else { 0.0 };
        self.eye.follow(show, width / height, panel / height);
    }

    pub(super) fn key(&mut self, key: Key, down: bool, show: &mut dyn Panel) {
        show.point(&self.pointer());
        match key {
            Key::Character('f') if down => self.eye.go_along(),
            // A thrown cube flies away, and a removed body moves the center.
            Key::Character('b' | 'x') | Key::Delete if down => self.eye.stay(),
            Key::Character('h') if down => self.panel = !self.panel,
            _ => {}
        }
    }

    fn pointer(&self) -> Pointer {
        let at = Vec2::new(self.mouse.x as f32, self.mouse.y as f32) / self.size() * 2.0 - 1.0;
        Pointer::through(&self.eye.camera, at * Vec2::new(1.0, -1.0), self.sight.aspect())
    }

    pub(super) fn button(&mut self, button: MouseButton, down: bool, show: &mut dyn Panel) {
        if !down && self.drag == Drag::Body {
            show.release();
        }
        self.drag = match (button, down) {
            (MouseButton::Left, true) if show.grab(&self.pointer()) => {
                self.eye.stay();
                Drag::Body
            }
            (MouseButton::Left | MouseButton::Right, true) => Drag::Orbit,
            (MouseButton::Middle, true) => Drag::Pan,
            _ => Drag::Nothing,
        };
    }

    pub(super) fn moved(&mut self, to: PhysicalPosition<f64>, show: &mut dyn Panel) {
        let by = Vec2::new((to.x - self.mouse.x) as f32, (to.y - self.mouse.y) as f32);
        let by = by / self.size().y;
        self.mouse = to;
        match self.drag {
            Drag::Body => show.drag(&self.pointer()),
            Drag::Orbit => self.eye.orbit(by),
            Drag::Pan => self.eye.pan(by),
            Drag::Nothing => {}
        }
    }

    /// Advances the time and draws. Returns whether the window still exists.
    pub(super) fn frame(&mut self, show: &mut dyn Panel) -> Result<bool> {
        let now = Instant::now();
        pollster::block_on(show.advance((now - self.last).as_secs_f32()))?;
        self.last = now;
        if self.drag == Drag::Body {
            // The camera and the body can move while the mouse does not.
            show.drag(&self.pointer());
        }

        let frame = match self.sight.next() {
            Next::Frame(frame) => frame,
            Next::Later => return Ok(true),
            Next::Gone => return Ok(false),
        };
        self.follow(show);
        self.sight.paint(&frame, show, &self.eye.camera);
        self.draw_panel(&frame.view, show);
        self.window.pre_present_notify();
        self.sight.present(frame);
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
                // A panel that is taller than the window scrolls.
                let most = ui.ctx().content_rect().height() - 64.0;
                let shown = window.resizable(false).vscroll(true).max_height(most).show(ui.ctx(), |ui| show.panel(ui));
                width = shown.map_or(0.0, |s| s.response.rect.width() * ui.ctx().pixels_per_point());
            }
        });
        // The width of the panel is known after the first frame.
        if width > 0.0 {
            self.panel_width = width;
        }
        self.ui.handle_platform_output(&self.window, output.platform_output);
        let triangles = context.tessellate(output.shapes, output.pixels_per_point);
        let screen = egui_wgpu::ScreenDescriptor {
            size_in_pixels: self.sight.size().into(),
            pixels_per_point: output.pixels_per_point,
        };
        let (device, queue) = (self.sight.device(), self.sight.queue());
        for (id, deltas) in &output.textures_delta.set {
            deltas.iter().for_each(|d| self.ui_renderer.update_texture(device, queue, *id, d));
        }
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        self.ui_renderer.update_buffers(device, queue, &mut encoder, &triangles, &screen);
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
        queue.submit([encoder.finish()]);
        for id in &output.textures_delta.free {
            self.ui_renderer.free_texture(id);
        }
        // egui panics if this is dropped with contents.
        output.textures_delta.clear();
    }
}
