//! The buffers of a device, one for each binding. A buffer grows with its rows, and the host remembers the content that
//! it knows.

use std::pin::Pin;
use std::sync::{Mutex, PoisonError};

use futures_channel::oneshot;
use rayon::prelude::*;

use super::bindings::Binding;
use super::submissions::Submissions;
use crate::error::{Error, Result};

/// Size of a block that is compared and sent as a whole (B).
const BLOCK: usize = 1024;
/// Smallest number of blocks, or rows, for a thread.
const MIN_BLOCKS: usize = 256;

/// The buffers of a device.
pub(super) struct Buffers {
    device: wgpu::Device,
    queue: wgpu::Queue,
    adapter: String,
    /// Largest buffer for a kernel (B).
    limit: u64,
    /// Largest total memory of all buffers (B).
    memory: u64,
    slots: Vec<Slot>,
    /// New buffers. The device has not yet confirmed their memory. Nobody waits for the lock: it makes futures `Sync`.
    created: Mutex<Vec<Created>>,
    /// A buffer that the device writes and the processor reads. One is enough: the host waits for every read-back
    /// before the next submission.
    staging: Option<wgpu::Buffer>,
    /// A counter that grows when a binding gets another buffer. Older bind groups are then invalid.
    pub generation: u64,
    sent: u64,
}

/// A new buffer: the error if the device lacks the memory, and the pending answer of the device.
struct Created {
    refusal: Error,
    is_refused: Pin<Box<dyn Future<Output = Option<wgpu::Error>> + Send>>,
}

#[derive(Default)]
struct Slot {
    buffer: Option<wgpu::Buffer>,
    /// The first bytes of the buffer, as far as the host knows them.
    known: Vec<u8>,
}

impl Buffers {
    pub fn new(device: wgpu::Device, queue: wgpu::Queue, adapter: String, [limit, memory]: [u64; 2]) -> Self {
        let slots = Binding::ALL.iter().map(|_| Slot::default()).collect();
        let limits = device.limits();
        let limit = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size).min(limit);
        Self {
            device,
            queue,
            adapter,
            limit,
            memory,
            slots,
            created: Mutex::default(),
            staging: None,
            generation: 0,
            sent: 0,
        }
    }

    pub fn get(&self, binding: Binding) -> &wgpu::Buffer {
        self.slots[binding as usize].buffer.as_ref().expect("every buffer is made before a kernel is bound")
    }

    /// Refuses rows that fit into no buffer.
    pub fn check(&self, binding: Binding, bytes: usize) -> Result<()> {
        if bytes as u64 <= self.limit {
            return Ok(());
        }
        let (bytes, limit, adapter, name) =
            (SizeText(bytes as u64), SizeText(self.limit), &self.adapter, binding.name());
        Err(Error::TooLarge(format!(
            "the {name} of this problem take {bytes}; a buffer of {adapter} holds at most {limit}: use --backend cpu"
        )))
    }

    /// Makes room for `size` bytes. The content can be lost.
    pub fn reserve(&mut self, binding: Binding, size: usize) -> Result<()> {
        let size = size as u64;
        let slot = &mut self.slots[binding as usize];
        if slot.buffer.as_ref().is_some_and(|b| b.size() >= size.max(16)) {
            return Ok(());
        }
        slot.known.clear();
        let usage = wgpu::BufferUsages::UNIFORM
            | wgpu::BufferUsages::STORAGE
            | wgpu::BufferUsages::COPY_DST
            | wgpu::BufferUsages::COPY_SRC;
        self.slots[binding as usize].buffer = Some(self.create(binding.name(), size, self.limit, usage)?);
        self.generation += 1;
        Ok(())
    }

    /// Makes room for `size` bytes. The first `kept` bytes stay.
    pub async fn grow(&mut self, binding: Binding, kept: usize, size: usize) -> Result<()> {
        let before = self.slots[binding as usize].buffer.clone();
        self.reserve(binding, size)?;
        if let Some(before) = before.filter(|b| b != self.get(binding)) {
            self.settle().await?;
            let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            encoder.copy_buffer_to_buffer(&before, 0, self.get(binding), 0, kept as u64);
            self.queue.submit([encoder.finish()]);
        }
        Ok(())
    }

    /// Sends rows, starting at the byte `at`.
    pub fn write(&mut self, binding: Binding, at: usize, bytes: &[u8]) {
        self.queue.write_buffer(self.get(binding), at as u64, bytes);
        self.sent += bytes.len() as u64;
    }

    /// Bytes that were sent since the last call.
    pub fn take_sent(&mut self) -> u64 {
        std::mem::take(&mut self.sent)
    }

    /// Sends all rows of a binding.
    pub fn send(&mut self, binding: Binding, bytes: &[u8]) -> Result<()> {
        self.reserve(binding, bytes.len())?;
        if !bytes.is_empty() {
            self.write(binding, 0, bytes);
        }
        Ok(())
    }

    /// Sends those rows of a binding that the device does not have yet.
    pub fn update(&mut self, binding: Binding, bytes: &[u8]) -> Result<()> {
        self.reserve(binding, bytes.len())?;
        let mut known = std::mem::take(&mut self.slots[binding as usize].known);
        let size = known.len();
        known.resize(bytes.len(), 0);
        let is_changed = |&at: &usize| {
            let block = at..(at + BLOCK).min(bytes.len());
            block.end > size || known[block.clone()] != bytes[block]
        };
        let blocks = (0..bytes.len().div_ceil(BLOCK)).into_par_iter().with_min_len(MIN_BLOCKS);
        let changed: Vec<usize> = blocks.map(|block| block * BLOCK).filter(is_changed).collect();
        let ranges =
            changed.chunk_by(|a, b| a + BLOCK == *b).map(|run| run[0]..(run[run.len() - 1] + BLOCK).min(bytes.len()));
        for range in ranges {
            self.write(binding, range.start, &bytes[range.clone()]);
            known[range.clone()].copy_from_slice(&bytes[range]);
        }
        self.slots[binding as usize].known = known;
        Ok(())
    }

    /// Records the content of a buffer. Empty `bytes` mean that the content is unknown.
    pub fn note(&mut self, binding: Binding, bytes: &[u8]) {
        let known = &mut self.slots[binding as usize].known;
        known.clear();
        known.extend_from_slice(bytes);
    }

    /// Records the content of a buffer from its rows.
    pub fn note_rows<T: bytemuck::Pod + Send>(
        &mut self,
        binding: Binding,
        rows: impl IndexedParallelIterator<Item = T>,
    ) {
        let known = &mut self.slots[binding as usize].known;
        known.resize(rows.len() * size_of::<T>(), 0);
        let places = known.par_chunks_exact_mut(size_of::<T>()).with_min_len(MIN_BLOCKS);
        places.zip(rows).for_each(|(place, row)| place.copy_from_slice(bytemuck::bytes_of(&row)));
    }

    fn created(&mut self) -> &mut Vec<Created> {
        self.created.get_mut().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits until the device has confirmed the memory of each new buffer.
    pub async fn settle(&mut self) -> Result<()> {
        let mut refusals = Vec::new();
        for Created { refusal, is_refused } in std::mem::take(self.created()) {
            if is_refused.await.is_some() {
                refusals.push(refusal);
            }
        }
        refusals.into_iter().next().map_or(Ok(()), Err)
    }

    /// Submits the encoder with its work on `rows` rows, and with copies of the `wanted` bindings and of the first
    /// bytes of another buffer, `more`. Waits, writes the copies to `wanted`, and returns those of `more` as numbers.
    /// If anything fails, nothing is written.
    pub async fn read_back(
        &mut self,
        submissions: &mut Submissions,
        (mut encoder, rows): (wgpu::CommandEncoder, usize),
        wanted: &mut [(Binding, &mut [u8])],
        more: Option<(&wgpu::Buffer, u64)>,
    ) -> Result<Vec<u64>> {
        let sum = wanted.iter().map(|(_, rows)| rows.len() as u64).sum::<u64>();
        // Align the numbers to 8 bytes.
        let (own, size) = (sum.next_multiple_of(8), sum.next_multiple_of(8) + more.map_or(0, |m| m.1));
        if size == 0 {
            submissions.submit(encoder);
            submissions.wait(rows).await?;
            return Ok(Vec::new());
        }
        // A dropped step leaves its buffer to wgpu.
        let staging = match self.staging.take().filter(|b| b.size() >= size) {
            Some(staging) => staging,
            None => {
                let usage = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST;
                self.create("read back", size, self.device.limits().max_buffer_size, usage)?
            }
        };
        self.settle().await?;
        let mut at = 0;
        for (binding, rows) in wanted.iter().filter(|w| !w.1.is_empty()) {
            encoder.copy_buffer_to_buffer(self.get(*binding), 0, &staging, at, rows.len() as u64);
            at += rows.len() as u64;
        }
        if let Some((buffer, bytes)) = more {
            encoder.copy_buffer_to_buffer(buffer, 0, &staging, own, bytes);
        }
        submissions.submit(encoder);
        let slice = staging.slice(..size);
        let (sender, receiver) = oneshot::channel();
        slice.map_async(wgpu::MapMode::Read, move |result| drop(sender.send(result)));
        submissions.wait(rows).await?;
        receiver.await.map_err(|e| submissions.lost(e))?.map_err(|e| submissions.lost(e))?;
        let mapped = slice.get_mapped_range().map_err(|e| submissions.lost(e))?;
        let mut rest = &mapped[..];
        for (_, rows) in wanted {
            let from = rest.split_off(..rows.len()).expect("as long as all rows");
            let (to, from) = (rows.par_chunks_mut(MIN_BLOCKS * BLOCK), from.par_chunks(MIN_BLOCKS * BLOCK));
            to.zip(from).for_each(|(to, from)| to.copy_from_slice(from));
        }
        let numbers = bytemuck::pod_collect_to_vec(&mapped[own as usize..]);
        drop(mapped);
        staging.unmap();
        self.staging = Some(staging);
        Ok(numbers)
    }

    /// A buffer for `size` bytes. Before its use, [`Self::settle`] has to confirm the memory.
    fn create(&mut self, name: &str, size: u64, limit: u64, usage: wgpu::BufferUsages) -> Result<wgpu::Buffer> {
        let scope = self.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let size = size_of_buffer(size, limit);
        let buffer = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(name),
            size,
            usage,
            mapped_at_creation: false,
        });
        let all = self.slots.iter().filter_map(|slot| slot.buffer.as_ref()).chain(&self.staging);
        let is_full = all.map(wgpu::Buffer::size).sum::<u64>() + size > self.memory;
        let (size, adapter) = (SizeText(size), &self.adapter);
        let refusal = Error::TooLarge(format!("{adapter} cannot allocate {size} for the {name}: use --backend cpu"));
        if is_full {
            return Err(refusal);
        }
        self.created().push(Created { refusal, is_refused: Box::pin(scope.pop()) });
        Ok(buffer)
    }
}

/// A size (B) in readable form.
struct SizeText(u64);

impl std::fmt::Display for SizeText {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self(bytes) = self;
        if *bytes < 1 << 20 { write!(f, "{bytes} B") } else { write!(f, "{} MiB", bytes >> 20) }
    }
}

/// Size of a buffer for `wanted` bytes. `wanted` is a multiple of 4 and at most `limit` (B), and so is the result.
/// Below the limit it is 1.5 times the wanted size, so that a growing pile does not need a new buffer every step.
pub(super) fn size_of_buffer(wanted: u64, limit: u64) -> u64 {
    (wanted + wanted / 2).next_multiple_of(16).max(256).min(limit / 4 * 4)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_buffer_holds_what_is_wanted_and_is_never_larger_than_the_adapter_allows() {
        let limits = [128 << 20, (1 << 31) - 1, 1 << 31, (1 << 32) - 4, 4096];
        for limit in limits {
            let largest = limit / 4 * 4;
            for wanted in [0, 4, 1024, limit / 2, limit / 3 * 2, largest - 12, largest - 4, largest] {
                let wanted = wanted / 4 * 4;
                let size = size_of_buffer(wanted, limit);
                assert!(
                    (wanted..=limit).contains(&size) && size.is_multiple_of(4),
                    "{size} B for {wanted} B, limit {limit} B"
                );
            }
        }
    }

    #[test]
    fn a_buffer_has_room_to_grow_by_half_up_to_the_limit() {
        assert_eq!(size_of_buffer(1 << 20, 1 << 31), 3 << 19);
        assert_eq!(size_of_buffer(3_000_000, 4_000_000), 4_000_000);
        // A buffer without rows is bound too.
        assert!(size_of_buffer(0, 1 << 20) >= 16);
    }
}
