//! Pictures on a canvas of the browser.

use drystone::{Error, Result};
use drystone_view::{Camera, Quality, Renderer, Shot, poses};
use wasm_bindgen::prelude::*;
use web_sys::HtmlCanvasElement;

use crate::maze::Maze;
use crate::show::Show;
use crate::thrown;

/// A canvas that worlds are drawn on.
#[wasm_bindgen]
pub struct Picture {
    surface: wgpu::Surface<'static>,
    config: wgpu::SurfaceConfiguration,
    device: wgpu::Device,
    queue: wgpu::Queue,
    backend: wgpu::Backend,
    quality: Quality,
    renderer: Option<Renderer>,
    /// What was drawn last ([`next_number`](crate::next_number)).
    drawn: u32,
}

impl Picture {
    async fn on(canvas: HtmlCanvasElement) -> Result<Self> {
        let none = |e: &dyn std::fmt::Display| {
            Error::Adapter(format!("this browser draws neither by WebGPU nor by WebGL ({e})"))
        };
        let descriptor = wgpu::InstanceDescriptor {
            backends: wgpu::Backends::BROWSER_WEBGPU | wgpu::Backends::GL,
            flags: wgpu::InstanceFlags::empty(),
            ..wgpu::InstanceDescriptor::new_without_display_handle()
        };
        let instance = wgpu::util::new_instance_with_webgpu_detection(descriptor).await;
        let (width, height) = (canvas.width().max(1), canvas.height().max(1));
        let surface = instance.create_surface(wgpu::SurfaceTarget::Canvas(canvas)).map_err(|e| none(&e))?;
        let options = wgpu::RequestAdapterOptions { compatible_surface: Some(&surface), ..Default::default() };
        let adapter = instance.request_adapter(&options).await.map_err(|e| none(&e))?;
        let backend = adapter.get_info().backend;
        let limits = match backend {
            wgpu::Backend::BrowserWebGpu => wgpu::Limits::default(),
            _ => wgpu::Limits::downlevel_webgl2_defaults().using_resolution(adapter.limits()),
        };
        let wanted = wgpu::DeviceDescriptor { required_limits: limits, ..Default::default() };
        let (device, queue) = adapter.request_device(&wanted).await.map_err(|e| none(&e))?;
        let config = surface.get_default_config(&adapter, width, height);
        let mut config = config.ok_or_else(|| none(&"no format for its canvas"))?;
        // The shaders encode sRGB themselves.
        let formats = surface.get_capabilities(&adapter).formats;
        config.format = formats.into_iter().find(|f| !f.is_srgb()).unwrap_or(config.format);
        let is_hardware = adapter.get_info().device_type != wgpu::DeviceType::Cpu;
        let quality = if is_hardware { Quality::FINE } else { Quality::FAST };
        Ok(Self { surface, config, device, queue, backend, quality, renderer: None, drawn: 0 })
    }

    /// Draws what has the number `number` on a canvas of `size` pixels.
    fn draw_show(
        &mut self,
        number: u32,
        show: &mut dyn drystone_view::Show,
        camera: &Camera,
        size: (u32, u32),
        ground: [f32; 3],
    ) -> Result<()> {
        if (self.config.width, self.config.height) != size {
            (self.config.width, self.config.height) = size;
            self.surface.configure(&self.device, &self.config);
        }
        let Self { device, queue, config, quality, .. } = self;
        let renderer =
            self.renderer.get_or_insert_with(|| Renderer::new(device, queue, config.format, *quality, show.world()));
        if std::mem::replace(&mut self.drawn, number) == number {
            renderer.follow(show.world());
        } else {
            renderer.replace(show.world());
        }
        renderer.background = ground;
        let (colors, lines, poses) = (show.colors(), show.lines(), poses(show.world()));
        let (bounds, container) = (show.bounds(), show.container());
        let shot = Shot { poses: &poses, colors: &colors, camera, bounds, container, lines: &lines };
        use wgpu::CurrentSurfaceTexture::{Lost, Outdated, Suboptimal, Success};
        let target = match self.surface.get_current_texture() {
            Success(target) | Suboptimal(target) => target,
            Outdated | Lost => {
                self.surface.configure(&self.device, &self.config);
                return Ok(());
            }
            // The canvas is hidden or late; the next picture may succeed.
            _ => return Ok(()),
        };
        let view = target.texture.create_view(&wgpu::TextureViewDescriptor::default());
        renderer.draw(&view, size, &shot);
        self.queue.present(target);
        Ok(())
    }
}

#[wasm_bindgen]
impl Picture {
    /// A picture on a canvas: by WebGPU, else by WebGL.
    pub async fn open(canvas: HtmlCanvasElement) -> std::result::Result<Picture, JsError> {
        thrown(Self::on(canvas).await)
    }

    /// What draws: `WebGPU` or `WebGL`.
    pub fn api(&self) -> String {
        if self.backend == wgpu::Backend::BrowserWebGpu { "WebGPU" } else { "WebGL" }.into()
    }

    /// Draws a scene on a canvas of `width` times `height` pixels, before a ground of some color (sRGB, 0 to 1).
    pub fn draw(
        &mut self,
        show: &mut Show,
        width: u32,
        height: u32,
        red: f32,
        green: f32,
        blue: f32,
    ) -> std::result::Result<(), JsError> {
        let camera = show.camera;
        thrown(self.draw_show(show.number, &mut show.live, &camera, (width, height), [red, green, blue]))
    }

    /// Draws a maze likewise.
    pub fn draw_maze(
        &mut self,
        maze: &mut Maze,
        width: u32,
        height: u32,
        red: f32,
        green: f32,
        blue: f32,
    ) -> std::result::Result<(), JsError> {
        let camera = maze.camera;
        thrown(self.draw_show(maze.number, &mut maze.labyrinth, &camera, (width, height), [red, green, blue]))
    }
}
