//! Pictures on a browser canvas.

use drystone::Result;
use drystone_view::{Camera, Next, Shades, Sight, wgpu};
use wasm_bindgen::prelude::*;
use web_sys::HtmlCanvasElement;

use crate::maze::Maze;
use crate::show::Show;
use crate::thrown;

/// A canvas for drawing worlds.
#[wasm_bindgen]
pub struct Picture {
    sight: Sight,
    /// The number of the last drawn world ([`next_number`](crate::next_number)).
    drawn: u32,
}

impl Picture {
    async fn on(canvas: HtmlCanvasElement, webgpu: bool) -> Result<Self> {
        let size = (canvas.width(), canvas.height());
        Ok(Self { sight: Sight::on_canvas(wgpu::SurfaceTarget::Canvas(canvas), size, webgpu).await?, drawn: 0 })
    }

    /// Draws the world with the number `number` on a canvas of `size` pixels.
    fn paint(
        &mut self,
        number: u32,
        show: &mut dyn drystone_view::Show,
        camera: &Camera,
        size: (u32, u32),
        background: [f32; 3],
    ) {
        if self.sight.size() != size {
            self.sight.resize(size);
        }
        if std::mem::replace(&mut self.drawn, number) != number {
            self.sight.renderer.replace(show.world());
        }
        self.sight.renderer.shades = Shades::before(background);
        if let Next::Frame(frame) = self.sight.next() {
            self.sight.paint(&frame, show, camera);
            self.sight.present(frame);
        }
    }
}

#[wasm_bindgen]
impl Picture {
    /// Opens a picture on a canvas: with WebGPU if the browser has it and `webgpu` allows it, else with WebGL.
    pub async fn open(canvas: HtmlCanvasElement, webgpu: bool) -> std::result::Result<Picture, JsError> {
        thrown(Self::on(canvas, webgpu).await)
    }

    /// The graphics API: `WebGPU` or `WebGL`.
    pub fn api(&self) -> String {
        if self.sight.api() == wgpu::Backend::BrowserWebGpu { "WebGPU" } else { "WebGL" }.into()
    }

    /// Whether the device of the picture is lost. Then another picture has to be opened.
    pub fn is_lost(&self) -> bool {
        self.sight.is_lost()
    }

    /// Draws a scene on a canvas of `width` times `height` pixels, in front of a background color (sRGB, 0 to 1).
    pub fn draw(&mut self, show: &mut Show, width: u32, height: u32, red: f32, green: f32, blue: f32) {
        let camera = show.camera;
        self.paint(show.number, &mut show.live, &camera, (width, height), [red, green, blue]);
    }

    /// Draws a maze in the same way.
    pub fn draw_maze(&mut self, maze: &mut Maze, width: u32, height: u32, red: f32, green: f32, blue: f32) {
        let camera = maze.camera;
        self.paint(maze.number, &mut maze.labyrinth, &camera, (width, height), [red, green, blue]);
    }
}
