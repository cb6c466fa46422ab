//! From the buffers of a device to memory, through one buffer that both can reach.

use super::bindings::Binding;
use super::buffers::{Buffers, size_of_buffer};

/// A buffer that the device writes and the processor reads.
///
/// One buffer is enough: the host waits for every read-back before the next submission.
pub(super) struct ReadBack {
    device: wgpu::Device,
    queue: wgpu::Queue,
    staging: Option<wgpu::Buffer>,
}

impl ReadBack {
    pub fn new(device: wgpu::Device, queue: wgpu::Queue) -> Self {
        Self { device, queue, staging: None }
    }

    /// Submits the encoder with copies of the `wanted` bindings, and of the first bytes of another buffer `more`. Waits, writes the
    /// copies to `wanted`, and returns those of `more` as numbers; else the reason why the device is lost.
    pub fn submit(
        &mut self,
        mut encoder: wgpu::CommandEncoder,
        buffers: &Buffers,
        wanted: &mut [(Binding, &mut [u8])],
        more: Option<(&wgpu::Buffer, u64)>,
    ) -> Result<Vec<u64>, String> {
        let sum = wanted.iter().map(|(_, rows)| rows.len() as u64).sum::<u64>();
        // The numbers are aligned to 8 bytes.
        let (own, size) = (sum.next_multiple_of(8), sum.next_multiple_of(8) + more.map_or(0, |m| m.1));
        if self.staging.as_ref().is_none_or(|b| b.size() < size) {
            self.staging = Some(self.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("read back"),
                size: size_of_buffer(size, self.device.limits().max_buffer_size),
                usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            }));
        }
        let staging = self.staging.as_ref().expect("made above");
        let mut at = 0;
        for (binding, rows) in wanted.iter().filter(|w| !w.1.is_empty()) {
            encoder.copy_buffer_to_buffer(buffers.get(*binding), 0, staging, at, rows.len() as u64);
            at += rows.len() as u64;
        }
        if let Some((buffer, bytes)) = more {
            encoder.copy_buffer_to_buffer(buffer, 0, staging, own, bytes);
        }
        self.queue.submit([encoder.finish()]);
        if size == 0 {
            self.device.poll(wgpu::PollType::wait_indefinitely()).map_err(|e| e.to_string())?;
            return Ok(Vec::new());
        }
        let slice = staging.slice(..size);
        let (sender, receiver) = std::sync::mpsc::channel();
        slice.map_async(wgpu::MapMode::Read, move |result| drop(sender.send(result)));
        self.device.poll(wgpu::PollType::wait_indefinitely()).map_err(|e| e.to_string())?;
        receiver.recv().map_err(|e| e.to_string())?.map_err(|e| e.to_string())?;
        let mapped = slice.get_mapped_range().map_err(|e| e.to_string())?;
        let mut rest = &mapped[..];
        for (_, rows) in wanted {
            rows.copy_from_slice(rest.split_off(..rows.len()).expect("as long as all rows"));
        }
        let numbers = bytemuck::pod_collect_to_vec(&mapped[own as usize..]);
        drop(mapped);
        staging.unmap();
        Ok(numbers)
    }
}
