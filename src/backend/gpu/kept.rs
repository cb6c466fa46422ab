//! Compiled pipelines that stay in a folder from one run to the next, if wgpu supports it (Vulkan).

use std::path::{Path, PathBuf};

use crate::saved::hash_of;

/// Size of the hash before the data (B).
const HASH: usize = 8;

/// The pipelines that a driver has compiled.
pub(super) struct KeptPipelines {
    cache: wgpu::PipelineCache,
    file: PathBuf,
}

impl KeptPipelines {
    /// Loads the pipelines of an earlier run from the folder. Returns `None` if wgpu keeps no pipelines of this
    /// adapter.
    #[allow(unsafe_code)]
    pub fn open(device: &wgpu::Device, folder: &Path) -> Option<Self> {
        // A web page has no files.
        if cfg!(target_family = "wasm") || !device.features().contains(wgpu::Features::PIPELINE_CACHE) {
            return None;
        }
        let file = folder.join(wgpu::util::pipeline_cache_key(&device.adapter_info())?);
        let kept = std::fs::read(&file).unwrap_or_default();
        let descriptor = wgpu::PipelineCacheDescriptor { label: Some("drystone"), data: whole(&kept), fallback: true };
        // SAFETY: the data must come from a cache of this kind. `write` wrote it, and the hash shows that it is
        // unchanged. wgpu compares adapter, driver and version, and starts with an empty cache if they differ.
        let cache = unsafe { device.create_pipeline_cache(&descriptor) };
        Some(Self { cache, file })
    }

    pub fn cache(&self) -> &wgpu::PipelineCache {
        &self.cache
    }

    /// Writes all pipelines for the next run. The file is either complete or absent. Without the file, the next run
    /// compiles again.
    pub fn write(&self) -> std::io::Result<()> {
        let Some(data) = self.cache.get_data().filter(|_| !cfg!(target_family = "wasm")) else { return Ok(()) };
        std::fs::create_dir_all(self.file.parent().expect("a file in a folder"))?;
        let part = self.file.with_extension(std::process::id().to_string());
        std::fs::write(&part, [&hash_of(&data).to_le_bytes()[..], &data].concat())?;
        std::fs::rename(&part, &self.file).inspect_err(|_| drop(std::fs::remove_file(&part)))
    }
}

/// The data after a matching hash.
fn whole(kept: &[u8]) -> Option<&[u8]> {
    let (hash, data) = kept.split_at_checked(HASH)?;
    (hash == hash_of(data).to_le_bytes()).then_some(data)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn data_that_changed_are_not_taken() {
        let data = [1, 2, 3];
        let mut kept = [&hash_of(&data).to_le_bytes()[..], &data].concat();
        assert_eq!(whole(&kept), Some(&data[..]));
        kept[9] ^= 1;
        assert_eq!(whole(&kept), None);
        assert_eq!((whole(&kept[..7]), whole(&[])), (None, None));
    }
}
