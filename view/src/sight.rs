//! A surface for shows: a window, or a browser canvas.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use drystone::{Error, Result, World};

use crate::camera::Camera;
use crate::pipeline::Quality;
use crate::poses::poses;
use crate::renderer::{Renderer, Shot};
use crate::show::Show;

/// A surface with its device and renderer.
pub struct Sight {
    device: wgpu::Device,
    queue: wgpu::Queue,
    surface: wgpu::Surface<'static>,
    config: wgpu::SurfaceConfiguration,
    api: wgpu::Backend,
    is_lost: Arc<AtomicBool>,
    pub renderer: Renderer,
}

/// The next picture of a surface.
pub enum Next {
    Frame(Frame),
    /// The surface is hidden or late, or was lost and is configured again: a later picture can succeed.
    Later,
    /// The surface is gone, like a window that another program closed.
    Gone,
}

/// A picture that is not presented yet.
pub struct Frame {
    texture: wgpu::SurfaceTexture,
    pub view: wgpu::TextureView,
}

impl Sight {
    /// A window of width and height `size` (pixels).
    ///
    /// # Errors
    /// No adapter can draw on the window.
    #[cfg(not(target_family = "wasm"))]
    pub fn on_window(
        display: Box<dyn wgpu::wgt::WgpuHasDisplayHandle>,
        window: impl Into<wgpu::SurfaceTarget<'static>>,
        size: (u32, u32),
    ) -> Result<Self> {
        let (surface, adapter, device, queue) = drystone::backend::gpu::open_for_surface(display, window)?;
        Self::of(surface, &adapter, device, queue, size)
    }

    /// A browser canvas of width and height `size` (device pixels). It uses WebGPU, or WebGL2 (feature `webgl`) if the
    /// browser has no WebGPU or `webgpu` is false. A canvas that was used for WebGPU no longer supports WebGL2: pass
    /// another canvas.
    ///
    /// # Errors
    /// The browser supports neither.
    #[cfg(target_family = "wasm")]
    pub async fn on_canvas(canvas: wgpu::SurfaceTarget<'static>, size: (u32, u32), webgpu: bool) -> Result<Self> {
        let neither = |e: &dyn std::fmt::Display| {
            let by = if cfg!(feature = "webgl") { "neither by WebGPU nor by WebGL2" } else { "not by WebGPU" };
            Error::Adapter(format!("this browser draws {by}: {e}"))
        };
        if !cfg!(feature = "webgl") && !wgpu::util::is_browser_webgpu_supported().await {
            return Err(neither(&"there is no adapter"));
        }
        let backends = if webgpu { wgpu::Backends::BROWSER_WEBGPU | wgpu::Backends::GL } else { wgpu::Backends::GL };
        let instance = wgpu::util::new_instance_with_webgpu_detection(wgpu::InstanceDescriptor {
            backends,
            flags: wgpu::InstanceFlags::empty(),
            ..wgpu::InstanceDescriptor::new_without_display_handle()
        })
        .await;
        let surface = instance.create_surface(canvas).map_err(|e| neither(&e))?;
        let options = wgpu::RequestAdapterOptions { compatible_surface: Some(&surface), ..Default::default() };
        let adapter = instance.request_adapter(&options).await.map_err(|e| neither(&e))?;
        // The renderer needs no more than WebGL2 has, except for the size of the canvas.
        let required_limits = wgpu::Limits::downlevel_webgl2_defaults().using_resolution(adapter.limits());
        let descriptor = wgpu::DeviceDescriptor { label: Some("drystone"), required_limits, ..Default::default() };
        let (device, queue) = adapter.request_device(&descriptor).await.map_err(|e| neither(&e))?;
        Self::of(surface, &adapter, device, queue, size)
    }

    fn of(
        surface: wgpu::Surface<'static>,
        adapter: &wgpu::Adapter,
        device: wgpu::Device,
        queue: wgpu::Queue,
        (width, height): (u32, u32),
    ) -> Result<Self> {
        let config = surface.get_default_config(adapter, width.max(1), height.max(1));
        let mut config = config.ok_or_else(|| Error::Adapter("the adapter cannot draw on this display".into()))?;
        // The shaders and egui encode sRGB themselves.
        let formats = surface.get_capabilities(adapter).formats;
        config.format = formats.into_iter().find(|f| !f.is_srgb()).unwrap_or(config.format);
        let renderer = Renderer::new(&device, &queue, config.format, Quality::of(adapter), &World::new());
        let is_lost = Arc::new(AtomicBool::new(false));
        let noted = is_lost.clone();
        device.set_device_lost_callback(move |_, _| noted.store(true, Ordering::Relaxed));
        let mut sight = Self { device, queue, surface, config, api: adapter.get_info().backend, is_lost, renderer };
        sight.resize((width, height));
        Ok(sight)
    }

    pub fn device(&self) -> &wgpu::Device {
        &self.device
    }

    pub fn queue(&self) -> &wgpu::Queue {
        &self.queue
    }

    /// The format of the pictures; it is not an sRGB format.
    pub fn format(&self) -> wgpu::TextureFormat {
        self.config.format
    }

    /// The graphics API: Vulkan, Metal, Direct3D, OpenGL (WebGL2 in a browser), or WebGPU.
    pub fn api(&self) -> wgpu::Backend {
        self.api
    }

    /// Whether the device is lost. Then nothing more is drawn, and another sight has to be opened.
    pub fn is_lost(&self) -> bool {
        self.is_lost.load(Ordering::Relaxed)
    }

    /// Width and height (pixels).
    pub fn size(&self) -> (u32, u32) {
        (self.config.width, self.config.height)
    }

    /// Width divided by height.
    pub fn aspect(&self) -> f32 {
        self.config.width as f32 / self.config.height as f32
    }

    /// Changes width and height of the pictures (pixels), up to the limit of the adapter. Returns whether the surface
    /// still exists.
    pub fn resize(&mut self, (width, height): (u32, u32)) -> bool {
        let most = self.device.limits().max_texture_dimension_2d;
        (self.config.width, self.config.height) = (width.clamp(1, most), height.clamp(1, most));
        self.configure()
    }

    /// Configures the surface. Returns whether it still exists.
    #[cfg(not(target_family = "wasm"))]
    fn configure(&self) -> bool {
        let refused = self.device.push_error_scope(wgpu::ErrorFilter::Validation);
        self.surface.configure(&self.device, &self.config);
        pollster::block_on(refused.pop()).is_none()
    }

    /// A canvas exists as long as its surface.
    #[cfg(target_family = "wasm")]
    fn configure(&self) -> bool {
        self.surface.configure(&self.device, &self.config);
        true
    }

    /// The next picture, empty.
    pub fn next(&self) -> Next {
        use wgpu::CurrentSurfaceTexture::{Lost, Outdated, Suboptimal, Success};
        match self.surface.get_current_texture() {
            Success(texture) | Suboptimal(texture) => {
                let view = texture.texture.create_view(&wgpu::TextureViewDescriptor::default());
                Next::Frame(Frame { texture, view })
            }
            Outdated | Lost if !self.configure() => Next::Gone,
            _ => Next::Later,
        }
    }

    /// Draws a show from `camera`. Before the first picture of another show, call [`Renderer::replace`] with its world.
    pub fn paint(&mut self, frame: &Frame, show: &mut dyn Show, camera: &Camera) {
        let (colors, lines) = (show.colors(), show.lines());
        let poses = poses(show.world());
        let (bounds, container) = (show.bounds(), show.container());
        let shot = Shot { poses: &poses, colors: &colors, camera, bounds, container, lines: &lines };
        self.renderer.follow(show.world());
        self.renderer.draw(&frame.view, (self.config.width, self.config.height), &shot);
    }

    /// Presents a picture.
    pub fn present(&self, frame: Frame) {
        self.queue.present(frame.texture);
    }
}
