use super::Scene;
use crate::error::Result;
pub struct Parameter {
    pub name: &'static str,
    pub default: f64,
    pub summary: &'static str,
}
pub struct Entry {
    pub name: &'static str,
    pub summary: &'static str,
    pub parameters: &'static [Parameter],
    build: fn(&[f64]) -> Result<Scene>,
}
impl Entry {
    pub fn build(&self, _p: &[String]) -> Result<Scene> {
        (self.build)(&[])
    }
}
pub static CATALOGUE: &[Entry] = &[];
