//! The motion of a run as CSV.

use std::fs::File;
use std::path::{Path, PathBuf};

use crate::files::Draft;
use drystone::{BodyKind, Error, Result, World};

/// A CSV file with the columns `step,time,body,px,py,pz,qx,qy,qz,qw,vx,vy,vz,wx,wy,wz`: center of mass, world axes. It
/// appears under its name after `finish`.
pub struct Trajectory {
    path: PathBuf,
    writer: csv::Writer<File>,
    draft: Draft,
}

impl Trajectory {
    pub fn create(path: &Path) -> Result<Self> {
        let draft = Draft::of(path)?;
        let mut trajectory = Self { path: path.into(), writer: csv::Writer::from_writer(draft.create()?), draft };
        let header = "step time body px py pz qx qy qz qw vx vy vz wx wy wz";
        let written = trajectory.writer.write_record(header.split(' '));
        trajectory.check(written)?;
        Ok(trajectory)
    }

    pub fn write(&mut self, step: u32, dt: f32, world: &World) -> Result<()> {
        for (i, body) in world.bodies.iter().enumerate().filter(|(_, b)| b.kind != BodyKind::Fixed) {
            let (p, q) = (body.center_of_mass(), body.rotation);
            let (v, w) = (body.linear_velocity, body.angular_velocity);
            let row =
                (step, f64::from(step) * f64::from(dt), i, p.to_array(), q.to_array(), v.to_array(), w.to_array());
            let written = self.writer.serialize(row);
            self.check(written)?;
        }
        Ok(())
    }

    pub fn finish(self) -> Result<()> {
        let unwritten = |e: csv::IntoInnerError<_>| Error::file(&self.path)(e.into_error());
        self.writer.into_inner().map_err(unwritten)?;
        self.draft.keep()
    }

    fn check(&self, written: csv::Result<()>) -> Result<()> {
        written.map_err(|e| Error::file(&self.path)(e.into()))
    }
}
