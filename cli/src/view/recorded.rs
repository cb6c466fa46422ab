//! Plays the motion in a CSV file of `drystone run --out` as a film.

use std::path::Path;

use drystone::glam::{Quat, Vec3};
use drystone::{BodyKind, Error, Result};
use drystone_scenes::Scene;
use drystone_view::{ColorBy, Film};

/// Step, time, body, center of mass, rotation and velocities, in the format of [`crate::report::Trajectory`].
type Row = (u32, f64, usize, [f32; 3], [f32; 4], [f32; 3], [f32; 3]);

/// A film of `scene` with the motion in the file `path`.
pub fn recorded(scene: Scene, color: ColorBy, path: &Path) -> Result<Film> {
    if matches!(color, ColorBy::Batch | ColorBy::Impulse | ColorBy::Sleeping | ColorBy::Effort) {
        let refusal = "--from: a recorded motion has neither contacts nor sleep; color by material or speed";
        return Err(Error::input(refusal));
    }
    let file = std::fs::File::open(path).map_err(Error::file(path))?;
    let mut world = scene.world.clone();
    let mut film = Film::new(scene, color);
    let mut last: Option<(u32, f64)> = None;
    for (i, row) in csv::Reader::from_reader(file).deserialize::<Row>().enumerate() {
        // Line 1 has the names of the columns.
        let line = i + 2;
        let refuse = |what: String| Error::input(format!("{}: line {line}: {what}", path.display()));
        let row = row.map_err(|e| match e.into_kind() {
            csv::ErrorKind::Io(e) => Error::file(path)(e),
            csv::ErrorKind::Deserialize { err, .. } => refuse(err.to_string()),
            csv::ErrorKind::UnequalLengths { len, .. } => refuse(format!("{len} values instead of 16")),
            _ => refuse("not a row of 16 numbers".into()),
        })?;
        let (step, time, index, place, [qx, qy, qz, qw], velocity, _) = row;
        if let Some((before, then)) = last.filter(|(before, _)| *before != step) {
            if step < before {
                return Err(refuse(format!("step {step} after step {before}")));
            }
            film.add_world(then, &world);
        }
        last = Some((step, time));
        let bodies = world.bodies.len();
        let body = world.bodies.handle(index).and_then(|body| world.body_mut(body));
        let Some(body) = body.filter(|b| b.kind != BodyKind::Fixed) else {
            return Err(refuse(format!("body {index} is fixed, or not among the {bodies} bodies of the scene")));
        };
        body.rotation = Quat::from_xyzw(qx, qy, qz, qw);
        body.position = Vec3::from_array(place) - body.rotation * body.mass.center;
        body.linear_velocity = Vec3::from_array(velocity);
    }
    match last {
        Some((_, time)) => film.add_world(time, &world),
        None => return Err(Error::input(format!("{}: the file has no rows", path.display()))),
    }
    Ok(film)
}
