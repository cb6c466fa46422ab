//! Textures, bindings and pipelines of the renderer.

/// The quality of pictures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Quality {
    /// Samples per pixel, 1 or 4.
    pub(crate) samples: u32,
    pub(crate) shadow_size: u32,
    /// Number of texels of the shadow map that are compared on each side of a point.
    pub(crate) shadow_reach: u32,
}

impl Quality {
    /// For pictures, and for windows on hardware.
    pub const FINE: Self = Self { samples: 4, shadow_size: 2048, shadow_reach: 1 };
    /// For windows on a software adapter.
    pub const FAST: Self = Self { samples: 1, shadow_size: 1024, shadow_reach: 0 };

    /// The quality that the adapter can draw in time.
    pub fn of(adapter: &wgpu::Adapter) -> Self {
        if adapter.get_info().device_type == wgpu::DeviceType::Cpu { Self::FAST } else { Self::FINE }
    }
}

pub(crate) const DEPTH: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;

pub(crate) fn texture(
    device: &wgpu::Device,
    (width, height): (u32, u32),
    format: wgpu::TextureFormat,
    sample_count: u32,
    usage: wgpu::TextureUsages,
) -> wgpu::Texture {
    device.create_texture(&wgpu::TextureDescriptor {
        label: None,
        size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage,
        view_formats: &[],
    })
}

pub(crate) fn cleared_depth(
    view: &wgpu::TextureView,
    store: wgpu::StoreOp,
) -> wgpu::RenderPassDepthStencilAttachment<'_> {
    let depth_ops = Some(wgpu::Operations { load: wgpu::LoadOp::Clear(1.0), store });
    wgpu::RenderPassDepthStencilAttachment { view, depth_ops, stencil_ops: None }
}

pub(crate) fn bind(
    device: &wgpu::Device,
    kinds: &[wgpu::BindingType],
    resources: &[wgpu::BindingResource],
) -> (wgpu::BindGroupLayout, wgpu::BindGroup) {
    let visibility = wgpu::ShaderStages::VERTEX_FRAGMENT;
    let entry = |(binding, &ty)| wgpu::BindGroupLayoutEntry { binding, visibility, ty, count: None };
    let entries: Vec<_> = (0..).zip(kinds).map(entry).collect();
    let layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: None, entries: &entries });
    let bound = (0..).zip(resources).map(|(binding, r)| wgpu::BindGroupEntry { binding, resource: r.clone() });
    let descriptor = wgpu::BindGroupDescriptor { label: None, layout: &layout, entries: &bound.collect::<Vec<_>>() };
    let group = device.create_bind_group(&descriptor);
    (layout, group)
}

pub(crate) fn layout_of<T>(
    step_mode: wgpu::VertexStepMode,
    attributes: &[wgpu::VertexAttribute],
) -> wgpu::VertexBufferLayout<'_> {
    wgpu::VertexBufferLayout { array_stride: size_of::<T>() as u64, step_mode, attributes }
}

pub(crate) struct Drawing<'a> {
    pub(crate) layout: &'a wgpu::BindGroupLayout,
    pub(crate) module: &'a wgpu::ShaderModule,
    pub(crate) vertex: &'a str,
    /// A pipeline without a fragment shader draws depth only.
    pub(crate) fragment: Option<&'a str>,
    pub(crate) buffers: &'a [wgpu::VertexBufferLayout<'a>],
    pub(crate) topology: wgpu::PrimitiveTopology,
    pub(crate) depth: wgpu::CompareFunction,
    pub(crate) format: wgpu::TextureFormat,
    pub(crate) quality: Quality,
}

pub(crate) fn pipeline(device: &wgpu::Device, d: &Drawing) -> wgpu::RenderPipeline {
    let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some(d.vertex),
        bind_group_layouts: &[Some(d.layout)],
        immediate_size: 0,
    });
    let targets = [Some(d.format.into())];
    let buffers: Vec<_> = d.buffers.iter().cloned().map(Some).collect();
    let constants = [("SHADOW_REACH", f64::from(d.quality.shadow_reach))];
    let compilation_options = wgpu::PipelineCompilationOptions::default;
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some(d.vertex),
        layout: Some(&layout),
        vertex: wgpu::VertexState {
            module: d.module,
            entry_point: Some(d.vertex),
            compilation_options: compilation_options(),
            buffers: &buffers,
        },
        fragment: d.fragment.map(|entry| wgpu::FragmentState {
            module: d.module,
            entry_point: Some(entry),
            compilation_options: wgpu::PipelineCompilationOptions {
                constants: if entry == "shade" { &constants } else { &[] },
                ..Default::default()
            },
            targets: &targets,
        }),
        primitive: wgpu::PrimitiveState { topology: d.topology, ..Default::default() },
        depth_stencil: Some(wgpu::DepthStencilState {
            format: DEPTH,
            depth_write_enabled: Some(d.depth == wgpu::CompareFunction::Less),
            depth_compare: Some(d.depth),
            stencil: wgpu::StencilState::default(),
            bias: wgpu::DepthBiasState::default(),
        }),
        multisample: wgpu::MultisampleState {
            count: if d.fragment.is_some() { d.quality.samples } else { 1 },
            ..Default::default()
        },
        multiview_mask: None,
        cache: None,
    })
}
