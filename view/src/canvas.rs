//! Pictures without a window: the renderer draws into a texture and reads it back.

use crate::pipeline::{Quality, texture};
use crate::renderer::{Renderer, Shot};
use drystone::backend::gpu::{AdapterChoice, open_device};
use drystone::{Error, Result, World};

/// Rows of pixels from the top, four bytes a pixel, sRGB.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Picture {
    pub width: u32,
    pub height: u32,
    pub rgba: Vec<u8>,
}

/// A texture for drawing and reading back pictures. Not available in a browser.
pub struct Canvas {
    device: wgpu::Device,
    queue: wgpu::Queue,
    pub renderer: Renderer,
    size: (u32, u32),
    texture: wgpu::Texture,
    read_back: wgpu::Buffer,
}

const FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8Unorm;

impl Canvas {
    /// A canvas of width and height `size` (pixels) for the bodies of `world`, on the best adapter.
    ///
    /// # Errors
    /// There is no adapter, or it cannot draw pictures of this size.
    pub fn new(world: &World, size: (u32, u32)) -> Result<Self> {
        let (device, queue, _) = open_device(AdapterChoice::Best)?;
        Self::on(device, queue, world, size)
    }

    /// The same on an open device.
    ///
    /// # Errors
    /// The device cannot draw pictures of this size.
    pub fn on(device: wgpu::Device, queue: wgpu::Queue, world: &World, (width, height): (u32, u32)) -> Result<Self> {
        let most = device.limits().max_texture_dimension_2d;
        if width == 0 || height == 0 || width > most || height > most {
            return Err(Error::input(format!("a picture of {width}x{height}: each side must be 1 to {most} pixels")));
        }
        let usage = wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC;
        let texture = texture(&device, (width, height), FORMAT, 1, usage);
        let read_back = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("picture"),
            size: u64::from(stride(width)) * u64::from(height),
            usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
            mapped_at_creation: false,
        });
        let renderer = Renderer::new(&device, &queue, FORMAT, Quality::FINE, world);
        Ok(Self { device, queue, renderer, size: (width, height), texture, read_back })
    }

    pub fn aspect(&self) -> f32 {
        self.size.0 as f32 / self.size.1 as f32
    }

    pub fn draw(&mut self, shot: &Shot) -> Result<Picture> {
        let view = self.texture.create_view(&wgpu::TextureViewDescriptor::default());
        self.renderer.draw(&view, self.size, shot);
        let (width, height) = self.size;
        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let layout = wgpu::TexelCopyBufferLayout { bytes_per_row: Some(stride(width)), ..Default::default() };
        let target = wgpu::TexelCopyBufferInfo { buffer: &self.read_back, layout };
        encoder.copy_texture_to_buffer(self.texture.as_image_copy(), target, self.texture.size());
        self.queue.submit([encoder.finish()]);
        let lost = |e: &dyn std::fmt::Display| Error::Adapter(format!("the device was lost: {e}"));
        let slice = self.read_back.slice(..);
        let (sender, receiver) = std::sync::mpsc::channel();
        slice.map_async(wgpu::MapMode::Read, move |result| drop(sender.send(result)));
        self.device.poll(wgpu::PollType::wait_indefinitely()).map_err(|e| lost(&e))?;
        receiver.recv().map_err(|e| lost(&e))?.map_err(|e| lost(&e))?;
        let mapped = slice.get_mapped_range().map_err(|e| lost(&e))?;
        let row = |r: &[u8]| r[..4 * width as usize].to_vec();
        let rgba = mapped.chunks_exact(stride(width) as usize).flat_map(row).collect();
        drop(mapped);
        self.read_back.unmap();
        Ok(Picture { width, height, rgba })
    }
}

/// Bytes of a row in the buffer; copies require a multiple of 256.
fn stride(width: u32) -> u32 {
    (4 * width).next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT)
}
