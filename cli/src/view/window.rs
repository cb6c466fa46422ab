//! The event loop of a window with a [`Show`](drystone_view::Show).

use winit::application::ApplicationHandler;
use winit::event::{ElementState, KeyEvent, MouseScrollDelta, WindowEvent};
use winit::event_loop::{ActiveEventLoop, ControlFlow, EventLoop};
use winit::keyboard::{Key, NamedKey};
use winit::window::WindowId;

use super::open::{Open, no_display};
use super::panel::Panel;
use drystone::{Error, Result};
use drystone_view::Key as ShowKey;

pub fn run(show: Box<dyn Panel>) -> Result<()> {
    let events = EventLoop::new().map_err(|_| no_display())?;
    events.set_control_flow(ControlFlow::Poll);
    let mut app = App { show, open: None, failed: None };
    events.run_app(&mut app).map_err(|e| Error::Adapter(format!("the window failed: {e}")))?;
    app.failed.map_or(Ok(()), Err)
}

struct App {
    show: Box<dyn Panel>,
    open: Option<Open>,
    failed: Option<Error>,
}

impl ApplicationHandler for App {
    fn resumed(&mut self, events: &ActiveEventLoop) {
        if self.open.is_none() {
            match Open::new(events, &*self.show) {
                Ok(open) => self.open = Some(open),
                Err(e) => self.end(events, Err(e)),
            }
        }
    }

    fn window_event(&mut self, events: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        let Some(open) = &mut self.open else { return };
        let taken = open.ui.on_window_event(&open.window, &event).consumed;
        match event {
            WindowEvent::CloseRequested | WindowEvent::Destroyed => events.exit(),
            WindowEvent::Resized(size) if open.resize(size.width, size.height) => {}
            WindowEvent::Resized(_) => events.exit(),
            WindowEvent::RedrawRequested => match open.frame(&mut *self.show) {
                Ok(true) => {}
                Ok(false) => events.exit(),
                Err(e) => self.end(events, Err(e)),
            },
            WindowEvent::KeyboardInput { event: KeyEvent { logical_key, state, repeat, .. }, .. } if !taken => {
                let down = state == ElementState::Pressed;
                if logical_key == Key::Named(NamedKey::Escape) {
                    return events.exit();
                }
                if let Some(key) = key_of(&logical_key).filter(|_| !repeat) {
                    open.key(key, down, &mut *self.show);
                    self.show.key(key, down);
                }
            }
            WindowEvent::MouseInput { state, button, .. } if !taken || state == ElementState::Released => {
                open.button(button, state == ElementState::Pressed, &mut *self.show);
            }
            WindowEvent::CursorMoved { position, .. } => open.moved(position, &mut *self.show),
            WindowEvent::MouseWheel { delta, .. } if !taken => open.eye.zoom(match delta {
                MouseScrollDelta::LineDelta(_, lines) => lines,
                MouseScrollDelta::PixelDelta(pixels) => pixels.y as f32 / 40.0,
            }),
            _ => {}
        }
    }

    fn about_to_wait(&mut self, _: &ActiveEventLoop) {
        if let Some(open) = &self.open {
            open.window.request_redraw();
        }
    }

    fn exiting(&mut self, _: &ActiveEventLoop) {
        // Drop the window before the event loop.
        self.open = None;
    }
}

fn key_of(key: &Key) -> Option<ShowKey> {
    match key.as_ref() {
        Key::Character(text) => ShowKey::named(text),
        Key::Named(NamedKey::Space) => Some(ShowKey::Character(' ')),
        Key::Named(NamedKey::Delete) => Some(ShowKey::Delete),
        Key::Named(NamedKey::ArrowLeft) => Some(ShowKey::Left),
        Key::Named(NamedKey::ArrowRight) => Some(ShowKey::Right),
        Key::Named(NamedKey::ArrowUp) => Some(ShowKey::Up),
        Key::Named(NamedKey::ArrowDown) => Some(ShowKey::Down),
        _ => None,
    }
}

impl App {
    fn end(&mut self, events: &ActiveEventLoop, result: Result<()>) {
        if let Err(e) = result {
            self.failed = Some(e);
            events.exit();
        }
    }
}
