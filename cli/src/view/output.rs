//! Picture files: PNG, animated GIF, a folder of PNGs, or MP4 by ffmpeg.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use crate::files::Draft;
use drystone::{Error, Result};
use drystone_view::Picture;

/// An open file or folder for pictures. It appears under its name with [`Output::finish`].
pub struct Output {
    path: PathBuf,
    /// Dropped before the draft, so that the writer ends first.
    format: Format,
    draft: Draft,
    size: (u32, u32),
    /// Duration of a GIF frame (1/100 s).
    delay: u16,
}

enum Format {
    Png(File),
    Gif(Box<gif::Encoder<BufWriter<File>>>),
    Frames(u32),
    Mp4(Ffmpeg),
}

/// A process that is killed if the output is dropped.
struct Ffmpeg(Child);

impl Drop for Ffmpeg {
    fn drop(&mut self) {
        // This fails if the process has already ended.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

impl Output {
    /// Refuses a path without a known extension.
    pub fn check(path: &Path) -> Result<()> {
        let known = path.extension().is_some_and(|e| e == "png" || e == "gif" || e == "mp4");
        if path.file_name().is_some() && (known || is_folder(path)) { Ok(()) } else { Err(unknown(path)) }
    }

    /// Opens `path` for pictures of `size` with `rate` pictures per second. The path ends in `.png`, `.gif` or `.mp4`,
    /// or in a slash for a folder of numbered PNGs.
    pub fn open(path: &Path, size: (u32, u32), rate: f64) -> Result<Self> {
        Self::check(path)?;
        let draft = Draft::of(path)?;
        let format = match path.extension().and_then(|e| e.to_str()) {
            _ if is_folder(path) => {
                std::fs::create_dir(draft.place()).map_err(Error::file(path))?;
                Format::Frames(0)
            }
            Some("png") => Format::Png(draft.create()?),
            Some("gif") => {
                let side =
                    |s: u32| u16::try_from(s).map_err(|_| Error::input(format!("{s} pixels: a GIF has at most 65535")));
                let mut encoder = gif::Encoder::new(BufWriter::new(draft.create()?), side(size.0)?, side(size.1)?, &[])
                    .map_err(|e| failed(path, e))?;
                encoder.set_repeat(gif::Repeat::Infinite).map_err(|e| failed(path, e))?;
                Format::Gif(Box::new(encoder))
            }
            Some("mp4") => {
                // Report a path that cannot be written before ffmpeg starts.
                drop(draft.create()?);
                Format::Mp4(ffmpeg(draft.place(), size, rate)?)
            }
            _ => return Err(unknown(path)),
        };
        let delay = (100.0 / rate).round().clamp(2.0, 1000.0) as u16;
        Ok(Self { path: path.into(), draft, format, size, delay })
    }

    pub fn add(&mut self, picture: &Picture) -> Result<()> {
        let path = &self.path;
        match &mut self.format {
            Format::Png(file) => write_png(file, picture).map_err(|e| failed(path, e)),
            Format::Frames(count) => {
                let folder = self.draft.place();
                let name = format!("{count:05}.png");
                *count += 1;
                let file = File::create(folder.join(&name)).map_err(Error::file(path.join(&name)))?;
                write_png(&file, picture).map_err(|e| failed(path, e))
            }
            Format::Gif(encoder) => {
                let (width, height) = (self.size.0 as u16, self.size.1 as u16);
                let mut frame = gif::Frame::from_rgba_speed(width, height, &mut picture.rgba.clone(), 10);
                frame.delay = self.delay;
                encoder.write_frame(&frame).map_err(|e| failed(path, e))
            }
            Format::Mp4(child) => {
                let Some(pipe) = &mut child.0.stdin else { return Ok(()) };
                pipe.write_all(&picture.rgba).map_err(|e| failed(path, format!("ffmpeg ended early: {e}")))
            }
        }
    }

    pub fn finish(self) -> Result<()> {
        let Self { path, draft, format, .. } = self;
        match format {
            Format::Gif(encoder) => {
                let mut file = encoder.into_inner().map_err(|e| failed(&path, e))?;
                file.flush().map_err(Error::file(&path))?;
            }
            Format::Mp4(mut child) => {
                drop(child.0.stdin.take());
                let status = child.0.wait().map_err(Error::file(&path))?;
                if !status.success() {
                    return Err(failed(&path, format!("ffmpeg ended with {status}")));
                }
            }
            Format::Frames(_) if path.is_dir() => {
                // An existing folder keeps its other files.
                for entry in std::fs::read_dir(draft.place()).map_err(Error::file(&path))? {
                    let entry = entry.map_err(Error::file(&path))?;
                    std::fs::rename(entry.path(), path.join(entry.file_name())).map_err(Error::file(&path))?;
                }
                return Ok(());
            }
            Format::Png(_) | Format::Frames(_) => {}
        }
        draft.keep()
    }
}

fn is_folder(path: &Path) -> bool {
    path.as_os_str().to_string_lossy().ends_with(['/', std::path::MAIN_SEPARATOR])
}

fn unknown(path: &Path) -> Error {
    let path = path.display();
    Error::input(format!("{path}: must end in .png, .gif or .mp4, or in / for a folder"))
}

fn failed(path: &Path, e: impl std::fmt::Display) -> Error {
    Error::file(path)(std::io::Error::other(e.to_string()))
}

fn write_png(file: &File, picture: &Picture) -> std::result::Result<(), png::EncodingError> {
    let mut encoder = png::Encoder::new(BufWriter::new(file), picture.width, picture.height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::High);
    let rgb: Vec<u8> = picture.rgba.chunks_exact(4).flat_map(|p| [p[0], p[1], p[2]]).collect();
    let mut writer = encoder.write_header()?;
    writer.write_image_data(&rgb)?;
    writer.finish()
}

/// An ffmpeg process that reads rows of pixels and writes H.264.
fn ffmpeg(to: &Path, (width, height): (u32, u32), rate: f64) -> Result<Ffmpeg> {
    let mut command = Command::new("ffmpeg");
    command.args(["-loglevel", "error", "-y", "-f", "rawvideo", "-pix_fmt", "rgba"]);
    command.args(["-s", &format!("{width}x{height}"), "-r", &format!("{rate:.4}"), "-i", "-"]);
    // Players require even sides.
    command.args(["-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2", "-pix_fmt", "yuv420p", "-c:v", "libx264", "-f", "mp4"]);
    command.arg(to).stdin(Stdio::piped()).spawn().map(Ffmpeg).map_err(|e| match e.kind() {
        std::io::ErrorKind::NotFound => {
            Error::input("mp4 needs ffmpeg, which is not installed; write a .gif or a folder instead")
        }
        _ => Error::file("ffmpeg")(e),
    })
}
