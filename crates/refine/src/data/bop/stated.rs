//! Names of bodies and sensors in the files that state them.

use std::path::Path;

use super::error::DatasetError;

/// Fields of a frame's bodies and sensors, for errors about them.
pub(crate) struct Stated<'a> {
    /// Files of bodies and of sensors.
    pub(crate) files: [&'a Path; 2],
    /// All bodies together.
    pub(crate) all: String,
    pub(crate) bodies: Vec<String>,
    pub(crate) sensors: Vec<String>,
    /// The field of the forces of a sensor.
    pub(crate) force: &'static str,
}

impl Stated<'_> {
    /// An error about all bodies together.
    pub(crate) fn all(&self, problem: impl ToString) -> DatasetError {
        DatasetError::field(self.files[0], &self.all, problem)
    }

    /// An error about `field` of body `k`.
    pub(crate) fn body(&self, k: usize, field: &str, problem: impl ToString) -> DatasetError {
        Self::fault(self.files[0], self.bodies.get(k), field, problem)
    }

    /// An error about `field` of sensor `k`, or about all of it if that is empty.
    pub(crate) fn sensor(&self, k: usize, field: &str, problem: impl ToString) -> DatasetError {
        Self::fault(self.files[1], self.sensors.get(k), field, problem)
    }

    fn fault(
        file: &Path,
        name: Option<&String>,
        field: &str,
        problem: impl ToString,
    ) -> DatasetError {
        let parts = [name.map_or("", |name| name.as_str()), field];
        let parts: Vec<&str> = parts.into_iter().filter(|part| !part.is_empty()).collect();
        DatasetError::field(file, &parts.join("."), problem)
    }
}
