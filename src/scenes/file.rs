use super::Scene;
use crate::error::Result;
pub struct SceneFile;
pub fn load(_p: &std::path::Path) -> Result<Scene> {
    todo!()
}
pub fn schema() -> serde_json::Value {
    todo!()
}
pub(super) fn load_or_suggest(_n: &str, _p: &[String]) -> Result<Scene> {
    todo!()
}
